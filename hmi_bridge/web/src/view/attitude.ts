// Directions and angles: number, and a bar against its limit.
import {html, nothing, svg, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import type {Reading, Readings} from '../state/readings';
import {NumberView} from './reading_view';

const ORDER = ['lead', 'look_up', 'roll_front', 'roll_rear', 'pitch_front', 'pitch_rear', 'articulation_right', 'articulation_up', 'articulation_roll'] as const;

function Gauge(reading: Reading): TemplateResult {
  const full = Math.max(reading.gauge, (reading.limit ?? 0) * 1.25);
  const at = (value: number) => 50 + 48 * Math.max(-1, Math.min(1, value / full));
  const {quality} = reading.judgement;
  const isLive = quality === 'ok' || quality === 'degraded' || quality === 'coasting';
  const isBeyond = isLive && reading.limit !== null && Math.abs(reading.value ?? 0) > reading.limit;
  return html`<svg class="gauge" viewBox="0 0 100 10" preserveAspectRatio="none" aria-hidden="true" data-beyond=${isBeyond}>
    <path class="line" d="M2 5H98"/>
    <path class="zero" d="M50 1V9"/>
    ${reading.limit === null ? nothing : svg`<path class="edge" d="M${at(reading.limit)} 0V10M${at(-reading.limit)} 0V10"/>`}
    ${isLive && reading.value !== null ? svg`<rect class="fill" x=${Math.min(50, at(reading.value))} y="3" width=${Math.abs(at(reading.value) - 50)} height="4"/>
      <rect class="hand" x=${at(reading.value) - 1} y="0.5" width="2" height="9"/>` : nothing}
  </svg>`;
}

export function Attitude(app: App, readings: Readings): TemplateResult {
  const {words} = app;
  return html`<section class="panel attitude" aria-label=${words.t('attitude')}>
    ${ORDER.map((id) => {
      const reading = readings.get(id);
      if (!reading) return nothing;
      return html`<div class="cell" data-quality=${reading.judgement.quality}>
        <span class="label" title=${reading.plus}>${reading.label}</span>
        ${NumberView(app, readings, id, {size: 'large'})}
        ${Gauge(reading)}
      </div>`;
    })}
    <p class="cell note">${words.t('angles')}: ${words.t(`angles_${app.settings.angles}`)}</p>
  </section>`;
}
