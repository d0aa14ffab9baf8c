// The dress of a number. A value that is not good is never in normal dress: word and shape besides colour.
import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {ClockTime, DASHES} from '../state/format';
import type {Judgement, Quality} from '../state/freshness';
import type {Reading, Readings} from '../state/readings';
import {ARROWS} from '../state/signs';
import type {Words} from '../text/index';

export const MARKS: Record<Quality, string> = {ok: '', degraded: '◇', coasting: '≈', stale: '▨', missing: '⊘'};

// One line of words: what is the matter, since when, why.
export function QualityText(judgement: Judgement, words: Words): string {
  const {quality, reason, since_utc_ms} = judgement;
  if (quality === 'ok') return words.t('quality_ok');
  const parts = [words.t(`quality_${quality}`)];
  if (since_utc_ms !== null) parts.push(words.t('since', {time: ClockTime(since_utc_ms)}));
  if (reason) parts.push(words.reason(reason));
  return parts.join(', ');
}

export function LastText(reading: Reading, words: Words): string {
  if (reading.judgement.quality !== 'stale' || reading.text === DASHES) return '';
  return words.t('last', {value: `${reading.text} ${reading.unit}`.trim(), time: ClockTime(reading.timing?.stamp_utc_ms ?? null)});
}

interface Dress {
  size?: 'huge' | 'large' | 'row';
  unit?: boolean;
  arrow?: boolean;
}

// A number on which a tap opens its details.
export function NumberView(app: App, readings: Readings, id: string, dress: Dress = {}): TemplateResult | typeof nothing {
  const reading = readings.get(id);
  if (!reading) return nothing;
  const {words} = app;
  const {quality} = reading.judgement;
  // For who hears the page: what it is before the number, what is the matter behind it.
  const behind = [quality === 'ok' ? '' : QualityText(reading.judgement, words), LastText(reading, words)].filter(Boolean).join(', ');
  return html`<button type="button" class="number ${dress.size ?? 'row'}" data-id=${id} data-quality=${quality} @click=${() => app.open({kind: 'reading', id})}>
    <span class="sr">${reading.label}: </span>${quality === 'stale'
      ? html`<span class="stale-word">${words.t('quality_stale')}</span><s class="last">${reading.text}</s>`
      : quality === 'missing'
        ? html`<span class="dashes">${DASHES}</span>`
        : html`${quality === 'ok' ? nothing : html`<span class="mark" aria-hidden="true">${MARKS[quality]}</span>`}<span class="digits">${
            dress.arrow && reading.direction ? html`<span class="arrow" aria-hidden="true">${ARROWS[reading.direction]}</span>` : nothing}${reading.text}</span>${
            dress.unit && reading.unit ? html` <span class="unit">${reading.unit}</span>` : nothing}`}${behind ? html`<span class="sr"> ${behind}</span>` : nothing}
  </button>`;
}

// The state of a row in one chip: shape and word.
export function QualityChip(judgement: Judgement, words: Words): TemplateResult {
  const {quality} = judgement;
  return html`<span class="quality" data-quality=${quality}>${
    quality === 'ok' ? nothing : html`<span aria-hidden="true">${MARKS[quality]} </span>`}${words.t(`quality_${quality}`)}</span>`;
}
