// The total station: where it stands, what its references say, and the move as a transaction.
import {html, nothing, svg, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {DateTime, DASHES, Fixed, Signed, Span} from '../state/format';
import {Judge, type Judgement} from '../state/freshness';
import {TickStep} from '../state/scale';
import {ClosureOf, MoveArgument, StepOf} from '../state/station_move';
import type {SetUp} from '../state/types';
import {Commands} from './alarms_page';
import {QualityChip} from './reading_view';

function JudgeSetUp(app: App, set_up: SetUp | null): Judgement {
  return Judge(set_up && {
    timing: set_up.timing,
    validity: set_up.state === 'good' ? 'valid' : set_up.state === 'suspect' ? 'degraded' : 'invalid',
    reason: set_up.reason,
  }, app.receipt, app.clocks());
}

const Triple = (values: number[] | (number | null)[] | null | undefined, digits: number) =>
  values ? values.map((value) => Fixed(value, digits)).join('  ') : DASHES;

function SetUpCard(app: App, role: 'in_use' | 'proposed' | 'previous'): TemplateResult {
  const {words, sections} = app;
  const set_up = sections.station?.[role] ?? null;
  const judged = JudgeSetUp(app, set_up);
  const none = !set_up || set_up.state === 'none';
  const closure = ClosureOf(set_up);
  const now = app.bridgeNow();
  return html`<section class="panel set-up" data-role=${role} data-quality=${judged.quality}>
    <h2>${words.t(`set_up_${role}`)}
      ${none ? nothing : html`<small>${words.t('set_up_number', {n: set_up.set_up_number})}</small>`}
      ${set_up && judged.quality === 'stale' ? QualityChip(judged, words) : nothing}
      ${none ? nothing : html`<span class="set-up-state" data-state=${set_up.state}>${set_up.state === 'suspect' ? '◇ ' : ''}${words.of('set_up_state_', set_up.state)}</span>`}</h2>
    ${set_up?.reason && !(none && role !== 'in_use') ? html`<p class="matter">${words.reason(set_up.reason)}</p>` : nothing}
    ${none ? html`<p class="calm">${words.t('set_up_none')}</p>` : html`<dl>
      <dt>${words.t('set_up_at')}</dt><dd>${DateTime(set_up.set_up_at_utc_ms)}</dd>
      ${role === 'in_use' ? html`<dt>${words.t('last_check')}</dt><dd>${DateTime(set_up.last_good_check_at_utc_ms)}${
        now !== null && set_up.last_good_check_at_utc_ms !== null ? html` <small>(${Span(now - set_up.last_good_check_at_utc_ms)})</small>` : nothing}</dd>` : nothing}
      <dt>${words.t('place')}</dt><dd class="mono">${Triple(set_up.position_in_site_m, 4)} m</dd>
      <dt>${words.t('place_sigma')}</dt><dd class="mono">${Triple(set_up.position_sigma_mm, 1)} mm</dd>
      <dt>${words.t('circle_zero')}</dt><dd class="mono">${Fixed(set_up.circle_zero_bearing_deg, 4)}° ± ${Fixed(set_up.circle_zero_sigma_deg, 4)}°</dd>
      ${set_up.sees_mm === null ? nothing : html`<dt>${words.t('sees')}</dt><dd>${Fixed(set_up.sees_mm, 1)} mm</dd>`}
      ${role !== 'proposed' ? nothing : html`
        <dt>${words.t('closure')}</dt><dd class="mono">${Triple(set_up.closure_mm, 1)} mm</dd>
        <dt>${words.t('closure_worst')}</dt><dd>${Fixed(set_up.closure_worst_mm, 1)} mm · ${words.t('closure_tolerance')} ${Fixed(set_up.closure_tolerance_mm, 1)} mm
          <br><b class="closure" data-closure=${closure}>${closure === 'missing' ? words.reason('closure_missing') : words.t(`closure_${closure}`)}</b>
          <small>${words.t('closure_points', {n: set_up.closure_points})}</small></dd>`}
    </dl>`}
  </section>`;
}

function References(app: App): TemplateResult {
  const {words, sections} = app;
  const step = StepOf(sections.station ?? null);
  const set_up = (step === 'proposed' ? sections.station?.proposed : null) ?? sections.station?.in_use ?? null;
  const references = set_up?.references ?? [];
  const largest = Math.max(1, ...references.flatMap((one) => [Math.abs(one.across_mm ?? 0), Math.abs(one.up_mm ?? 0)]));
  const scale = TickStep(largest * 1.1, 1);
  const px = 82 / scale;
  return html`<section class="panel references">
    <h2>${words.t('references')} ${set_up ? html`<small>${words.t(step === 'proposed' ? 'set_up_proposed' : 'set_up_in_use')}</small>` : nothing}</h2>
    ${references.length === 0 ? html`<p class="calm">${words.t('references_none')}</p>` : html`<div class="split">
    <table><thead><tr><th scope="col">${words.t('point')}</th><th scope="col" class="num">${words.t('across')} mm</th><th scope="col" class="num">${words.t('up')} mm</th>
      <th scope="col" class="num">${words.t('slope')} mm</th><th scope="col" class="num">${words.t('standardised')}</th><th scope="col">${words.t('quality')}</th></tr></thead>
      <tbody>${references.map((one) => html`<tr data-reference=${one.name} data-used=${one.used}>
        <th scope="row">${one.name}</th><td class="num">${Signed(one.across_mm, 1)}</td><td class="num">${Signed(one.up_mm, 1)}</td><td class="num">${Signed(one.slope_mm, 1)}</td>
        <td class="num">${Fixed(one.standardised, 1)}</td>
        <td>${one.reason ? one.reason === 'control' ? html`<span>${words.reason(one.reason)}</span>` : html`<span class="matter">◇ ${words.reason(one.reason)}</span>` : words.t(one.used ? 'used' : 'not_used')}</td></tr>`)}</tbody></table>
    <svg class="residuals" viewBox="-100 -100 200 200" role="img" aria-label=${words.t('references_picture')}>
      <g class="grid"><circle r=${scale * px}/><circle r=${(scale * px) / 2}/><path d="M-90 0H90M0-90V90"/></g>
      <text class="figure" x=${scale * px} y="11" text-anchor="middle">${scale}</text>
      ${references.map((one) => one.across_mm === null || one.up_mm === null ? nothing : svg`<g class="reference" data-used=${one.used} transform="translate(${(one.across_mm * px).toFixed(1)} ${(-one.up_mm * px).toFixed(1)})">
        ${one.used ? svg`<circle r="4"/>` : svg`<path d="M-4-4L4 4M4-4L-4 4"/>`}<text x="6" y="-4">${one.name}</text></g>`)}
    </svg></div>`}
  </section>`;
}

function Button(app: App, verb: string, isPossible: boolean, ask?: () => void): TemplateResult {
  const {words} = app;
  const why = app.isDown ? words.t('needs_connection') : app.may('surveyor') ? '' : words.t('needs_surveyor', {role: words.of('role_', app.me?.role ?? '')});
  return html`<button type="button" class="act" data-verb=${verb} ?disabled=${why !== '' || !isPossible} title=${why}
    @click=${ask ?? (() => void app.ask({addressee: 'total_station', verb, argument: '', because: ''}))}>${words.of('verb_', verb)}</button>`;
}

function Move(app: App): TemplateResult {
  const {words, sections} = app;
  const station = sections.station ?? null;
  const step = StepOf(station);
  const why = app.isDown ? words.t('needs_connection') : app.may('surveyor') ? '' : words.t('needs_surveyor', {role: words.of('role_', app.me?.role ?? '')});
  const closure = ClosureOf(station?.proposed ?? null);
  const confirm = (verb: string, text: string) => () => app.open({kind: 'confirm', text, request: {addressee: 'total_station', verb, argument: '', because: ''}});
  const propose = (event: SubmitEvent) => {
    event.preventDefault();
    const form = new FormData(event.target as HTMLFormElement);
    const made = MoveArgument(String(form.get('place') ?? ''), String(form.get('aim') ?? ''));
    app.move_fault = 'fault' in made ? words.t(made.fault === 'place' ? 'move_bad_place' : 'move_bad_aim') : '';
    if ('argument' in made) void app.ask({addressee: 'total_station', verb: 'propose_move', argument: made.argument, because: ''});
    app.schedule(true);
  };
  const references = station?.in_use?.references ?? [];
  const current = {idle: 1, away: 2, proposed: 4}[step];
  return html`<section class="panel move" data-step=${step}>
    <h2>${words.t('move')}</h2>
    ${why ? html`<p class="hint">${why}</p>` : nothing}
    <ol>
      <li data-current=${current === 1}><p>${words.t('move_step_1')}</p><p class="row">${Button(app, 'pause', step === 'idle')}${Button(app, 'resume', step === 'away')}</p></li>
      <li data-current=${current === 2}><p>${words.t('move_step_2')}</p></li>
      <li data-current=${current === 2}><p>${words.t('move_step_3')}</p>
        <form class="propose" @submit=${propose}>
          <label>${words.t('move_place')}<input name="place" inputmode="text" autocomplete="off" placeholder=${words.t('move_place_form')} ?disabled=${why !== ''}></label>
          <label>${words.t('move_aim')}<input name="aim" list="aims" autocomplete="off" maxlength="32" ?disabled=${why !== ''}></label>
          <datalist id="aims">${references.map((one) => html`<option value=${one.name}></option>`)}</datalist>
          <button type="submit" class="act" data-verb="propose_move" ?disabled=${why !== ''} title=${why}>${words.t('verb_propose_move')}</button>
          ${app.move_fault ? html`<p class="fault" role="alert"><span aria-hidden="true">▲</span> ${app.move_fault}</p>` : nothing}
        </form></li>
      <li data-current=${current === 4}><p>${words.t('move_step_4')}</p>
        ${step === 'proposed' ? html`<p class="closure" data-closure=${closure}>${closure === 'missing' ? words.reason('closure_missing')
          : html`${Fixed(station?.proposed?.closure_worst_mm, 1)} mm ${closure === 'good' ? '≤' : '>'} ${Fixed(station?.proposed?.closure_tolerance_mm, 1)} mm: ${words.t(`closure_${closure}`)}`}</p>` : nothing}
        <p class="row">${Button(app, 'take_over_move', step === 'proposed' && closure === 'good', confirm('take_over_move', words.t('confirm_take_over')))}
          ${Button(app, 'give_up_move', step === 'proposed', confirm('give_up_move', words.t('confirm_give_up')))}
          ${Button(app, 'undo_move', step !== 'proposed' && !!station?.previous && station.previous.state !== 'none', confirm('undo_move', words.t('confirm_undo')))}</p></li>
    </ol>
    <p class="row">${Button(app, 'check_references', step === 'idle')}</p>
  </section>`;
}

export function StationPage(app: App): TemplateResult {
  const {words, sections} = app;
  const observations = sections.station?.observations ?? [];
  return html`<main class="page page-station" id="content">
    <div class="cards">${SetUpCard(app, 'in_use')}${SetUpCard(app, 'proposed')}${SetUpCard(app, 'previous')}</div>
    <div class="columns">
      ${References(app)}
      ${Move(app)}
    </div>
    <section class="panel list"><h2>${words.t('observations')}</h2>
      <table class="wide"><tbody>${observations.map((one) => html`<tr data-status=${one.status}>
        <th scope="row">${one.target}</th><td>${words.of('kind_', one.kind)}</td><td>${words.t('face', {n: one.face})}</td><td class="num">${DateTime(one.at_utc_ms)}</td>
        <td class="num">${Fixed(one.slope_m, 4)} m</td>
        <td>${one.status === 'good' ? words.t('quality_ok') : html`<span class="matter">${one.status === 'none' ? '⊘' : '◇'} ${words.t(one.status === 'none' ? 'quality_missing' : 'quality_degraded')}</span>`} ${one.reason ? words.reason(one.reason) : nothing}</td></tr>`)}</tbody></table>
    </section>
    ${Commands(app)}
  </main>`;
}
