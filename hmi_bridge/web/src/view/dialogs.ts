// What opens above the page: details of a number, of a device, of a source, and what is asked before a command.
import {html, nothing, type TemplateResult} from 'lit';

import {RequestFor, ShelfChoices} from '../state/alarms';
import type {App, Dialog} from '../state/app';
import {DateTime, Fixed, Signed, Span} from '../state/format';
import {Judge, type Judgement} from '../state/freshness';
import type {Guidance} from '../state/types';
import {StateOf} from './devices';
import {QualityChip, QualityText, LastText} from './reading_view';

function Line(term: string, value: unknown): TemplateResult | typeof nothing {
  return value === '' || value === null || value === nothing ? nothing : html`<dt>${term}</dt><dd>${value}</dd>`;
}

function AgeLine(app: App, judged: Judgement, stale_after_ms: number | null): TemplateResult | typeof nothing {
  if (judged.age_ms === null) return nothing;
  return Line(app.words.t('age'), html`${Span(judged.age_ms)}${stale_after_ms === null ? nothing : html` <small>(${app.words.t('stale_after', {span: Span(stale_after_ms)})})</small>`}`);
}

function Sources(app: App, guidance: Guidance): TemplateResult {
  const {words} = app;
  return html`<h3>${words.t('sources')}</h3><table><tbody>${guidance.sources.map((source) => html`<tr>
    <th scope="row">${words.of('source_', source.name)}</th><td>${words.of('source_', source.freshness)}</td>
    <td class="num">${source.age_s === null ? '' : Span(source.age_s * 1000)}</td><td>${source.reason ? words.reason(source.reason) : ''}</td></tr>`)}</tbody></table>`;
}

function ReadingDetails(app: App, id: string): TemplateResult {
  const {words, sections} = app;
  const reading = app.readings().get(id);
  if (!reading) return html`<p>${words.reason('never_heard')}</p>`;
  const {judgement: judged} = reading;
  const isLive = judged.quality === 'ok' || judged.quality === 'degraded' || judged.quality === 'coasting';
  const band = isLive && reading.value !== null && reading.sigma !== null && reading.unit !== 'm' && reading.unit !== ''
    ? `${Signed(reading.value - 1.96 * reading.sigma, 1)} … ${Signed(reading.value + 1.96 * reading.sigma, 1)} ${reading.unit}` : '';
  return html`<h2>${reading.label}</h2>
    <p class="value" data-quality=${judged.quality}>${isLive ? html`${reading.text} <small>${reading.unit}</small>` : judged.quality === 'stale' ? html`<span class="stale-word">${words.t('quality_stale')}</span>` : '– –'}
      ${QualityChip(judged, words)}</p>
    <dl>
      ${Line(words.t('quality'), QualityText(judged, words))}
      ${Line('', nothing)}
      ${judged.quality === 'stale' ? Line(words.t('value'), LastText(reading, words)) : nothing}
      ${isLive && reading.sigma !== null ? Line(words.t('sigma'), `${reading.sigma_text} ${reading.unit === 'm' ? '' : reading.unit}`) : nothing}
      ${Line(words.t('band95'), band)}
      ${reading.limit === null ? nothing : Line(words.t('limit'), `±${Fixed(reading.limit, 1)} ${reading.unit}`)}
      ${Line(words.t('trend'), isLive ? reading.trend : '')}
      ${AgeLine(app, judged, reading.timing?.stale_after_ms ?? null)}
      ${Line(words.t('stamp'), reading.timing ? DateTime(reading.timing.stamp_utc_ms) : '')}
      ${reading.rests_on_s === null ? nothing : Line(words.t('rests_on'), Span(reading.rests_on_s * 1000))}
      ${Line(words.t('validity'), reading.validity ? words.of('validity_', reading.validity) : '')}
      ${Line(words.t('reason'), words.reason(judged.reason))}
      ${Line(words.t('signs'), reading.plus)}
    </dl>
    ${reading.about_guidance && sections.guidance ? Sources(app, sections.guidance) : nothing}`;
}

function DeviceDetails(app: App, id: string): TemplateResult {
  const {words, sections} = app;
  const device = sections.devices?.find((one) => one.id === id);
  if (!device) return html`<h2>${words.device(id)}</h2><p>${words.reason('never_heard')}</p>`;
  const {state, since_utc_ms} = StateOf(app, device);
  const judged = Judge({timing: device.timing, validity: 'valid', reason: ''}, app.receipt, app.clocks());
  return html`<h2>${words.device(id)}</h2>
    <dl>
      ${Line(words.t('quality'), html`<b>${words.of('device_', state)}</b> ${words.t('since', {time: DateTime(since_utc_ms)})}`)}
      ${Line(words.t('detail'), device.detail)}
      ${Line(words.t('samples_good'), device.samples_good)}
      ${Line(words.t('samples_lost'), device.samples_lost)}
      ${Line(words.t('errors'), device.errors)}
      ${Line(words.t('reconnects'), device.reconnects)}
      ${AgeLine(app, judged, device.timing.stale_after_ms)}
      ${Line(words.t('stamp'), DateTime(device.timing.stamp_utc_ms))}
    </dl><p><code>${device.id}</code></p>`;
}

function SourceDetails(app: App, name: string): TemplateResult {
  const {words, sections} = app;
  const guidance = sections.guidance ?? null;
  const prisms = guidance?.prisms;
  return html`<h2>${words.of('source_', name)}</h2>${guidance ? Sources(app, guidance) : nothing}
    ${name === 'station' && prisms ? html`<dl>${Line(words.t('kind_prism'), prisms.used)}${Line(words.t('rms'), `${Fixed(prisms.rms_mm, 1)} mm`)}${Line(words.t('detail'), prisms.remark)}</dl>` : nothing}`;
}

function AlarmForm(app: App, dialog: Extract<Dialog, {kind: 'alarm'}>): TemplateResult {
  const {words} = app;
  const {alarm, verb} = dialog;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const because = String(new FormData(event.target as HTMLFormElement).get('because') ?? '').trim();
    if (verb === 'shelve' && !because) {
      app.open({...dialog, fault: words.t('because_missing')});
      return;
    }
    app.open(null);
    void app.ask(RequestFor(alarm, verb, because, dialog.minutes));
  };
  return html`<form @submit=${submit} data-verb=${verb}>
    <h2>${words.t(verb)}</h2>
    <p>${words.cause(alarm)}</p>
    ${verb === 'shelve' ? html`<fieldset><legend>${words.t('shelve_for')}</legend>
      ${ShelfChoices(alarm.urgency).map((minutes) => html`<button type="button" data-minutes=${minutes} aria-pressed=${dialog.minutes === minutes}
        @click=${() => app.open({...dialog, minutes})}><span aria-hidden="true">${dialog.minutes === minutes ? '◉' : '○'}</span> ${minutes >= 60 ? words.t('hours', {n: minutes / 60}) : words.t('minutes', {n: minutes})}</button>`)}
    </fieldset>` : nothing}
    <label>${words.t(verb === 'shelve' ? 'because_needed' : 'because_optional')}<input name="because" maxlength="100" autocomplete="off" autofocus></label>
    <p class="fault" role="alert">${dialog.fault ? html`<span aria-hidden="true">▲</span> ${dialog.fault}` : nothing}</p>
    <p class="row"><button type="submit" class="act">${words.t(verb)}</button>
      <button type="button" class="act quiet" @click=${() => app.open(null)}>${words.t('cancel')}</button></p>
  </form>`;
}

function Confirm(app: App, dialog: Extract<Dialog, {kind: 'confirm'}>): TemplateResult {
  const {words} = app;
  return html`<h2>${words.of('verb_', dialog.request.verb)}</h2><p>${dialog.text}</p>
    <p class="row"><button type="button" class="act confirm" @click=${() => {
      app.open(null);
      void app.ask(dialog.request);
    }}>${words.t('yes')}</button><button type="button" class="act quiet" @click=${() => app.open(null)}>${words.t('cancel')}</button></p>`;
}

export function DialogBody(app: App): TemplateResult | typeof nothing {
  const {dialog, words} = app;
  if (!dialog) return nothing;
  const close = html`<button type="button" class="close" aria-label=${words.t('close')} @click=${() => app.open(null)}>✕</button>`;
  switch (dialog.kind) {
    case 'reading': return html`${close}${ReadingDetails(app, dialog.id)}`;
    case 'device': return html`${close}${DeviceDetails(app, dialog.id)}`;
    case 'source': return html`${close}${SourceDetails(app, dialog.name)}`;
    case 'alarm': return html`${close}${AlarmForm(app, dialog)}`;
    case 'confirm': return html`${close}${Confirm(app, dialog)}`;
  }
}
