import {html, nothing, type TemplateResult} from 'lit';
import {repeat} from 'lit/directives/repeat.js';

import {api} from '../state/api';
import type {App} from '../state/app';
import {CellText, Matching, ParseCsv, type Table} from '../state/csv';
import {DateTime} from '../state/format';
import type {Report, ReportRequest} from '../state/types';
import {Fill, type Params} from '../text/index';
import {REPORT_TEXTS, type ReportKey} from '../text/reports';

const MOST_SHOTS_BYTES = 200_000;
const DAY_MS = 24 * 3600 * 1000;
const MOST_ROWS = 300;
const SEARCHED = ['event', 'command', 'command_reply'];
const TOPICS = [...SEARCHED, 'guidance', 'shield_pose', 'relative_pose', 'station_observation', 'station_set_up', 'inclination',
  'device_health'];
// What a search is of no use for.
const HIDDEN_COLUMNS = new Set(['log_time_utc_ns', 'log_sequence', 'machine_id', 'sample_number', 'request_id']);

// What this page alone knows: faults of its forms, the table that is looked at.
const kept = {
  faults: new Map<string, string>(),
  table: null as {report: string; name: string; state: 'loading' | 'failed' | Table} | null,
  question: '',
};

const Say = (app: App) => (key: ReportKey, params: Params = {}) => Fill(REPORT_TEXTS[app.settings.language][key], params);

async function Start(app: App, kind: string, request: ReportRequest): Promise<void> {
  const answer = await api.report(request);
  if (answer.ok) kept.faults.delete(kind);
  else kept.faults.set(kind, answer.text || app.words.of('error_', answer.error));
  app.schedule(true);
}

function Fault(kind: string): TemplateResult {
  const text = kept.faults.get(kind);
  return html`<p class="fault" role="alert">${text ? html`<span aria-hidden="true">▲</span> ${text}` : nothing}</p>`;
}

function Card(app: App, kind: 'axis_check' | 'accuracy' | 'export', fields: TemplateResult | typeof nothing,
    ask: (form: HTMLFormElement) => Promise<ReportRequest | string>): TemplateResult {
  const say = Say(app);
  const {words} = app;
  const why = app.isDown ? words.t('needs_connection')
    : app.may('surveyor') ? '' : say('needs_surveyor', {role: words.of('role_', app.me?.role ?? '')});
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const request = await ask(event.target as HTMLFormElement);
    if (typeof request === 'string') {
      kept.faults.set(kind, request);
      app.schedule(true);
      return;
    }
    await Start(app, kind, request);
  };
  return html`<form class="panel report-form" data-kind=${kind} @submit=${submit}>
    <h2>${say(kind)}</h2><p class="calm">${say(`${kind}_lead`)}</p>
    ${fields}
    ${Fault(kind)}
    ${why ? html`<p class="hint">${why}</p>` : nothing}
    <button type="submit" class="act" ?disabled=${why !== ''} title=${why}>${say('make')}</button>
  </form>`;
}

function AccuracyCard(app: App): TemplateResult {
  const say = Say(app);
  const points = app.sections.machine?.points ?? [];
  const fields = html`
    <label>${say('shots_file')}<input type="file" name="shots" accept=".csv,.gsi,.txt"></label>
    <label>${say('points')}<select name="point"><option value="">${say('points_all')}</option>
      ${points.map((point) => html`<option value=${point.name}>${app.words.point(point.name)}</option>`)}</select></label>`;
  return Card(app, 'accuracy', fields, async (form) => {
    const data = new FormData(form);
    const file = data.get('shots');
    if (!(file instanceof File) || file.size === 0) return say('shots_missing');
    if (file.size > MOST_SHOTS_BYTES) return say('shots_too_large');
    const point = String(data.get('point') ?? '');
    return {kind: 'accuracy', points: point ? [point] : [], shots_text: await file.text()};
  });
}

const ForInput = (utc_ms: number) => new Date(utc_ms).toISOString().slice(0, 16);

function ExportCard(app: App): TemplateResult {
  const say = Say(app);
  const now = app.bridgeNow() ?? Date.now();
  const fields = html`
    <div class="pair">
      <label>${say('from_utc')}<input type="datetime-local" name="from" value=${ForInput(now - 3_600_000)} required></label>
      <label>${say('to_utc')}<input type="datetime-local" name="to" value=${ForInput(now + 60_000)} required></label>
    </div>
    <fieldset><legend>${say('topics')}</legend>${TOPICS.map((topic) => html`<label class="tick">
      <input type="checkbox" name="topic" value=${topic} ?checked=${SEARCHED.includes(topic)}> ${topic}</label>`)}</fieldset>`;
  return Card(app, 'export', fields, async (form) => {
    const data = new FormData(form);
    const from_utc_ms = Date.parse(`${String(data.get('from'))}Z`);
    const to_utc_ms = Date.parse(`${String(data.get('to'))}Z`);
    if (!(from_utc_ms < to_utc_ms) || to_utc_ms - from_utc_ms > DAY_MS) return say('times_wrong');
    const topics = data.getAll('topic').map(String);
    if (topics.length === 0) return say('topics_missing');
    return {kind: 'export', topics, from_utc_ms, to_utc_ms};
  });
}

const PathOf = (report: Report, name: string) => `/api/reports/${report.id}/${encodeURIComponent(name)}`;

async function Look(app: App, report: Report, name: string): Promise<void> {
  kept.table = {report: report.id, name, state: 'loading'};
  app.schedule(true);
  const text = await api.text(PathOf(report, name));
  if (kept.table?.report !== report.id || kept.table.name !== name) return;
  kept.table.state = text === null ? 'failed' : ParseCsv(text);
  app.schedule(true);
}

function TableView(app: App, report: Report): TemplateResult | typeof nothing {
  const say = Say(app);
  const {table} = kept;
  if (!table || table.report !== report.id) return nothing;
  if (table.state === 'loading') return html`<p class="calm">${say('loading')}</p>`;
  if (table.state === 'failed') return html`<p class="fault" role="alert">▲ ${say('not_loaded')}</p>`;
  const {header, rows} = table.state;
  const found = Matching(table.state, kept.question);
  const columns = header.map((name, index) => ({name, index})).filter(({name}) => !HIDDEN_COLUMNS.has(name));
  return html`<div class="search"><label>${say('search')} <code>${table.name}</code>
      <input type="search" .value=${kept.question} @input=${(event: Event) => {
        kept.question = (event.target as HTMLInputElement).value;
        app.schedule(true);
      }}></label>
    <span>${say('rows_of', {n: found.length, all: rows.length})}${found.length > MOST_ROWS ? html`; ${say('rows_first', {n: MOST_ROWS})}` : nothing}</span></div>
    <div class="scroll" tabindex="0"><table class="wide"><thead><tr>${columns.map(({name}) => html`<th scope="col">${name}</th>`)}</tr></thead>
      <tbody>${found.slice(0, MOST_ROWS).map((row) => html`<tr>${columns.map(({name, index}) => html`<td>${CellText(name, row[index] ?? '')}</td>`)}</tr>`)}</tbody></table></div>`;
}

function ReportRow(app: App, report: Report): TemplateResult {
  const say = Say(app);
  const pictures = report.files.filter((file) => file.name.endsWith('.png'));
  return html`<li class="report" data-id=${report.id} data-kind=${report.kind} data-state=${report.state}>
    <h3>${say(report.kind)} <b class="outcome" data-state=${report.state}>${say(`state_${report.state}`)}</b>
      <small>${say('by', {who: report.by, time: DateTime(report.asked_at_utc_ms)})}</small></h3>
    ${report.text ? html`<pre class="mono" tabindex="0">${report.text}</pre>` : nothing}
    ${pictures.map((file) => html`<a href=${PathOf(report, file.name)} target="_blank" rel="noopener"><img src=${PathOf(report, file.name)} alt="${say(report.kind)}: ${file.name}" loading="lazy"></a>`)}
    <p class="row">${report.files.filter((file) => !file.name.endsWith('.png')).map((file) => html`
      <a class="file" href=${PathOf(report, file.name)} download>${file.name} <small>${Math.ceil(file.bytes / 1000)} kB</small></a>
      ${SEARCHED.includes(file.name.replace('.csv', '')) ? html`<button type="button" class="act quiet" @click=${() => void Look(app, report, file.name)}>${say('show')}</button>` : nothing}`)}</p>
    ${TableView(app, report)}
  </li>`;
}

function Calibrations(app: App): TemplateResult {
  const say = Say(app);
  const now = app.bridgeNow() ?? 0;
  const list = app.sections.machine?.calibrations ?? [];
  return html`<section class="panel list"><h2>${say('calibrations')}</h2>
    ${list.length === 0 ? html`<p class="calm">${say('calibrations_none')}</p>` : html`<table class="wide">
      <thead><tr><th></th><th scope="col">${say('calibrated')}</th><th scope="col">${say('due')}</th><th></th></tr></thead>
      <tbody>${list.map((one) => {
        const days = Math.ceil((one.due_at_utc_ms - now) / DAY_MS);
        const isDue = now >= one.due_at_utc_ms;
        return html`<tr data-due=${isDue}><th scope="row">${one.what}</th><td>${DateTime(one.done_at_utc_ms).slice(0, 10)}</td><td>${DateTime(one.due_at_utc_ms).slice(0, 10)}</td>
          <td>${isDue ? html`<b class="due">▲ ${say('overdue', {n: -days})}</b>` : say('due_in', {n: days})}</td></tr>`;
      })}</tbody></table>`}
  </section>`;
}

function Versions(app: App): TemplateResult {
  const say = Say(app);
  const {bridge, guidance, camera, devices} = app.sections;
  const line = (name: string, value: string | number | undefined) => html`<dt>${name}</dt><dd class="mono">${value || '–'}</dd>`;
  return html`<section class="panel list"><h2>${say('versions')}</h2>
    <dl>${line(say('bridge'), bridge?.version)}${line(say('page'), bridge?.page_build)}
      ${line(say('started'), bridge ? DateTime(bridge.started_at_utc_ms) : '')}${line(say('dds_domain'), bridge?.dds.domain)}
      ${line(say('machine_file'), guidance?.machine_sha256)}${line(say('axis_file'), guidance?.axis_sha256)}${line(say('rig_file'), camera?.pose?.rig_sha256)}</dl>
    <table class="wide"><thead><tr><th scope="col">${say('device')}</th>${(['good', 'lost', 'errors', 'reconnects'] as const).map((key) => html`<th scope="col">${say(key)}</th>`)}</tr></thead>
      <tbody>${(devices ?? []).map((device) => html`<tr><th scope="row">${app.words.device(device.id)}</th><td>${device.samples_good}</td><td>${device.samples_lost}</td><td>${device.errors}</td><td>${device.reconnects}</td></tr>`)}</tbody></table>
  </section>`;
}

export function ReportsPage(app: App): TemplateResult {
  const say = Say(app);
  const reports = app.sections.reports ?? [];
  return html`<main class="page page-reports" id="content">
    <div class="cards">${Card(app, 'axis_check', nothing, async () => ({kind: 'axis_check'}))}${AccuracyCard(app)}${ExportCard(app)}</div>
    <section class="panel list"><h2>${say('list')}</h2>
      ${reports.length === 0 ? html`<p class="calm">${say('none')}</p>` : html`<ul class="report-list">${repeat(reports, (one) => one.id, (one) => ReportRow(app, one))}</ul>`}
    </section>
    ${Calibrations(app)}
    ${Versions(app)}
  </main>`;
}
