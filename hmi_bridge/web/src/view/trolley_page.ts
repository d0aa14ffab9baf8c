// The trolley on the rails: where it is, what holds it there, and what its last finished line says of the rail.
import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {DateTime, DASHES, Span} from '../state/format';
import {Judge} from '../state/freshness';
import {TrolleyPart} from '../state/readings';
import {NumberView, QualityChip, QualityText} from './reading_view';

const AGES = ['target', 'tilt', 'rest'] as const;

function Age(seconds: number | null | undefined): string {
  return typeof seconds === 'number' && Number.isFinite(seconds) ? Span(seconds * 1000) : DASHES;
}

function Settlement(app: App): TemplateResult {
  const {words} = app;
  const found = app.sections.trolley?.settlement ?? null;
  return html`<section class="panel list" data-alert=${found?.highest_alert ?? ''}>
    <h2>${words.t('trolley_settlement')}</h2>
    ${found === null ? html`<p class="calm">${words.t('trolley_settlement_none')}</p>` : html`
      <p>${words.t('trolley_lines', {base: found.base_run, later: found.later_run, time: DateTime(found.at_utc_ms)})}</p>
      <p>${found.highest_alert > 0
        ? html`<b class="matter">▲ ${words.t('trolley_alert', {n: found.highest_alert})}</b>`
        : words.t('trolley_alert_none')}</p>`}
  </section>`;
}

export function TrolleyPage(app: App): TemplateResult {
  const {words} = app;
  const state = app.sections.trolley?.state ?? null;
  const judged = Judge(TrolleyPart(state), app.receipt, app.clocks());
  const isLive = state !== null && judged.quality !== 'stale' && judged.quality !== 'missing';
  const readings = app.readings();
  return html`<main class="page page-trolley" id="content">
    <section class="facts">
      ${(['trolley_distance', 'trolley_speed'] as const).map((id) => html`<div class="fact" data-fact=${id}
        data-quality=${readings.get(id)?.judgement.quality ?? 'missing'}><span class="label">${readings.get(id)?.label}</span>${
          NumberView(app, readings, id, {size: 'large', unit: true})}</div>`)}
    </section>
    <section class="panel list" data-status=${state?.status ?? ''} data-quality=${judged.quality}>
      <h2>${words.t('trolley_place')} ${QualityChip(judged, words)}</h2>
      <p>${judged.quality === 'ok' ? words.t('trolley_fixed') : html`<b class="matter">${QualityText(judged, words)}</b>`}</p>
      <table><thead><tr><th scope="col">${words.t('trolley_axis')}</th><th scope="col" class="num">m</th><th scope="col" class="num">${words.t('sigma')} mm</th></tr></thead>
        <tbody>${(['x', 'y', 'z'] as const).map((axis) => {
          const id = `trolley_${axis}`;
          return html`<tr><th scope="row">${axis}</th><td class="num">${NumberView(app, readings, id)}</td>
            <td class="num">${isLive ? readings.get(id)?.sigma_text.replace(' mm', '') : DASHES}</td></tr>`;
        })}</tbody></table>
      <dl>
        <dt>${words.t('trolley_run')}</dt><dd>${state?.run || DASHES}</dd>
        ${AGES.map((what) => html`<dt>${words.t(`trolley_age_${what}`)}</dt><dd>${isLive ? Age(state[`${what}_age_s`]) : DASHES}</dd>`)}
        ${state ? html`<dt>${words.t('trolley_losses')}</dt><dd>${words.t('trolley_losses_are', {gaps: state.gaps, late: state.came_too_late})}</dd>` : nothing}
      </dl>
    </section>
    ${Settlement(app)}
  </main>`;
}
