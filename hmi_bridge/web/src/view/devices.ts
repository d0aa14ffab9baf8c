// All devices and sources in one row: shape and word, colour only for the abnormal.
import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {ClockTime, Span} from '../state/format';
import {Judge} from '../state/freshness';
import type {Device} from '../state/types';

export type DeviceState = Device['state'] | 'lost';

const MARKS: Record<DeviceState, string> = {streaming: '●', opening: '◐', closed: '○', silent: '▨', fault: '▲', lost: '✕'};

export function StateOf(app: App, device: Device): {state: DeviceState; since_utc_ms: number} {
  const judged = Judge({timing: device.timing, validity: 'valid', reason: ''}, app.receipt, app.clocks());
  if (judged.quality === 'stale') return {state: 'lost', since_utc_ms: judged.since_utc_ms ?? device.since_utc_ms};
  return {state: device.state, since_utc_ms: device.since_utc_ms};
}

export function Devices(app: App): TemplateResult {
  const {words, sections} = app;
  const guidance = sections.guidance ?? null;
  const judged = Judge(guidance && {timing: guidance.timing, validity: 'valid', reason: ''}, app.receipt, app.clocks());
  const devices = sections.devices ?? [];
  return html`<footer class="devices" aria-label=${words.t('devices')}>
    ${devices.length === 0 ? html`<span class="calm">${words.t('no_devices')}</span>` : nothing}
    ${devices.map((device) => {
      const {state, since_utc_ms} = StateOf(app, device);
      return html`<button type="button" class="chip" data-device=${device.id} data-state=${state} @click=${() => app.open({kind: 'device', id: device.id})}>
        <span class="mark" aria-hidden="true">${MARKS[state]}</span>
        <span class="name">${words.device(device.id)}</span>
        <span class="state">${words.of('device_', state)}${state === 'streaming' ? nothing : html`<span class="since">${ClockTime(since_utc_ms)}</span>`}</span>
      </button>`;
    })}
    ${guidance ? html`<span class="divider" aria-hidden="true"></span>${guidance.sources.map((source) => {
      const freshness = judged.quality === 'stale' ? 'stale' : source.freshness;
      return html`<button type="button" class="chip source" data-source=${source.name} data-state=${freshness} @click=${() => app.open({kind: 'source', name: source.name})}>
        <span class="mark" aria-hidden="true">${{fresh: '●', coasting: '≈', stale: '▨', missing: '⊘'}[freshness]}</span>
        <span class="name">${words.of('source_', source.name)}</span>
        <span class="state">${words.of('source_', freshness)}${freshness === source.freshness && freshness !== 'fresh' && source.age_s !== null ? html`<span class="since">${Span(source.age_s * 1000)}</span>` : nothing}</span>
      </button>`;
    })}` : nothing}
  </footer>`;
}
