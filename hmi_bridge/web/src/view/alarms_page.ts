import {html, nothing, type TemplateResult} from 'lit';
import {repeat} from 'lit/directives/repeat.js';

import type {App} from '../state/app';
import {IsUnacknowledged, KeyOf} from '../state/alarms';
import {ClockTime, DateTime, Fixed} from '../state/format';
import type {Alarm, Command} from '../state/types';
import {AcknowledgeButton, SilentText, UrgencyIcon} from './banner';

function WhyNot(app: App): string {
  const {words} = app;
  if (app.isDown) return words.t('needs_connection');
  return app.may('operator') ? '' : words.t('needs_operator', {role: words.of('role_', app.me?.role ?? '')});
}

function Row(app: App, alarm: Alarm): TemplateResult {
  const {words, sections} = app;
  const key = KeyOf(alarm);
  const isShelved = app.alarms().shelved.includes(alarm);
  const why = WhyNot(app);
  const silent = SilentText(app, alarm);
  return html`<li class="alarm" data-key=${key} data-urgency=${alarm.urgency} data-phase=${alarm.phase} data-waiting=${IsUnacknowledged(alarm)}>
    ${UrgencyIcon(alarm.urgency)}
    <div class="body">
      <p class="cause"><b>${words.t(`urgency_${alarm.urgency}`)}</b> ${words.cause(alarm)}
        ${sections.alarms?.first_out === key ? html`<span class="first" title=${words.t('first_out_long')}>① ${words.t('first_out')}</span>` : nothing}</p>
      <p class="response"><small>${words.t('response')}:</small> ${words.response(alarm)}</p>
      <p class="particulars">
        <span class="phase">${words.of('phase_', alarm.phase)}</span>
        ${alarm.raised_at_utc_ms === null ? nothing : html`<span>${words.t('alarm_raised', {time: DateTime(alarm.raised_at_utc_ms)})}</span>`}
        ${alarm.times_raised > 1 ? html`<span>${words.t('alarm_times', {n: alarm.times_raised})}</span>` : nothing}
        ${alarm.unit && alarm.value !== null ? html`<span>${Fixed(alarm.value, 1)} ${alarm.unit}${alarm.raise_above === null ? nothing : html` (${words.t('alarm_limit', {value: Fixed(alarm.raise_above, 1)})})`}</span>` : nothing}
        ${alarm.acknowledged_by ? html`<span>${words.t('acknowledged_by', {who: alarm.acknowledged_by})}</span>` : nothing}
        ${isShelved ? html`<span>${words.t('shelved_until', {time: ClockTime(alarm.shelved_until_utc_ms), who: alarm.shelved_by, why: alarm.shelved_because})}</span>` : nothing}
        ${silent ? html`<span class="silent">⊘ ${silent}</span>` : nothing}
        <code>${key}</code>
      </p>
    </div>
    <div class="acts">
      ${AcknowledgeButton(app, alarm)}
      ${isShelved
        ? html`<button type="button" class="act" ?disabled=${why !== ''} title=${why} @click=${() => app.open({kind: 'alarm', verb: 'unshelve', alarm, minutes: 0, fault: ''})}>${words.t('unshelve')}</button>`
        : html`<button type="button" class="act quiet shelve" ?disabled=${why !== ''} title=${why} @click=${() => app.open({kind: 'alarm', verb: 'shelve', alarm, minutes: 15, fault: ''})}>${words.t('shelve')}</button>`}
    </div>
  </li>`;
}

export function CommandRow(app: App, command: Command): TemplateResult {
  const {words} = app;
  return html`<tr data-request=${command.request_id} data-state=${command.state}>
    <td class="num">${ClockTime(command.issued_at_utc_ms)}</td>
    <td>${command.by}</td>
    <td>${words.of('verb_', command.verb)} ${command.argument}</td>
    <td>${command.because}</td>
    <td><b class="outcome" data-state=${command.state}>${words.of('state_', command.state)}</b> ${command.text}</td>
  </tr>`;
}

export function Commands(app: App): TemplateResult {
  const {words, sections} = app;
  const commands = sections.commands ?? [];
  return html`<section class="panel list"><h2>${words.t('commands')}</h2>
    ${commands.length === 0 ? html`<p class="calm">${words.t('commands_none')}</p>` : html`<table class="wide">
      <tbody>${repeat(commands, (one) => one.request_id, (one) => CommandRow(app, one))}</tbody></table>`}
  </section>`;
}

export function AlarmsPage(app: App): TemplateResult {
  const {words} = app;
  const view = app.alarms();
  const why = WhyNot(app);
  return html`<main class="page page-alarms" id="content">
    ${why ? html`<p class="panel hint">${why}</p>` : nothing}
    <section class="panel list"><h2>${words.t('alarm_list')} (${view.active.length})</h2>
      ${view.active.length === 0 ? html`<p class="calm">${app.sections.alarms ? words.t('alarm_none') : words.reason('never_heard')}</p>`
        : html`<ul class="alarm-list">${repeat(view.active, KeyOf, (alarm) => Row(app, alarm))}</ul>`}
    </section>
    <section class="panel list"><h2>${words.t('shelved')} (${view.shelved.length})</h2>
      ${view.shelved.length === 0 ? html`<p class="calm">${words.t('shelved_none')}</p>`
        : html`<ul class="alarm-list shelved">${repeat(view.shelved, KeyOf, (alarm) => Row(app, alarm))}</ul>`}
    </section>
    ${Commands(app)}
  </main>`;
}

export function EventsPage(app: App): TemplateResult {
  const {words, sections} = app;
  const events = sections.events ?? [];
  return html`<main class="page page-events" id="content"><section class="panel list"><h2>${words.t('event_list')}</h2>
    ${events.length === 0 ? html`<p class="calm">${words.t('event_none')}</p>` : html`<table class="wide">
      <tbody>${events.map((event) => html`<tr data-severity=${event.severity} data-active=${event.active}>
        <td class="num">${DateTime(event.at_utc_ms)}</td>
        <td><b class="severity" data-severity=${event.active ? event.severity : 'info'}>${{info: '·', warning: '◇', alarm: '▲'}[event.severity]} ${words.of('severity_', event.severity)}</b>${
          event.active || event.severity === 'info' ? nothing : html` (${words.t('event_over')})`}</td>
        <td>${event.source}</td>
        <td>${event.text || event.code.replaceAll('_', ' ')}</td>
      </tr>`)}</tbody></table>`}
  </section></main>`;
}
