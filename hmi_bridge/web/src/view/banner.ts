import {html, nothing, svg, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {IsUnacknowledged, KeyOf, URGENCIES} from '../state/alarms';
import {ClockTime} from '../state/format';
import type {Alarm, Urgency} from '../state/types';

// Urgency by shape, figure and word; colour comes last.
export function UrgencyIcon(urgency: Urgency): TemplateResult {
  const shape = {
    high: svg`<path d="M2 2h20v20H2z"/>`,
    medium: svg`<path d="M12 1.5L23 22H1z"/>`,
    low: svg`<path d="M12 1l11 11-11 11L1 12z"/>`,
  }[urgency];
  const figure = {high: '1', medium: '2', low: '3'}[urgency];
  return html`<svg class="urgency" data-urgency=${urgency} viewBox="0 0 24 24" aria-hidden="true">${shape}<text x="12" y=${urgency === 'medium' ? 19.5 : 17}>${figure}</text></svg>`;
}

export function SilentText(app: App, alarm: Alarm): string {
  const {words} = app;
  if (app.isDown && app.receipt) return words.t('alarm_silent_connection', {time: ClockTime(app.receipt.at_utc_ms)});
  if (alarm.silent_since_utc_ms !== null) return words.t('alarm_silent', {time: ClockTime(alarm.silent_since_utc_ms)});
  return '';
}

export function AcknowledgeButton(app: App, alarm: Alarm): TemplateResult | typeof nothing {
  if (!IsUnacknowledged(alarm)) return nothing;
  const {words} = app;
  const why = app.isDown ? words.t('needs_connection') : app.may('operator') ? '' : words.t('needs_operator', {role: words.of('role_', app.me?.role ?? '')});
  return html`<button type="button" class="act acknowledge" ?disabled=${why !== ''} title=${why}
    @click=${() => app.open({kind: 'alarm', verb: 'acknowledge', alarm, minutes: 15, fault: ''})}>${words.t('acknowledge')}</button>`;
}

export function Banner(app: App): TemplateResult {
  const {words, sections} = app;
  const view = app.alarms();
  const {worst} = view;
  const isDown = app.live.state === 'down' && app.receipt !== null;
  if (!worst) {
    return html`<section class="banner" data-urgency="none" aria-label=${words.t('alarm_bar')}>
      <span class="calm">${isDown ? words.t('no_connection_help') : sections.alarms ? words.t('alarm_none') : words.reason('never_heard')}</span>
      ${view.shelved.length ? html`<a class="shelved-count" href="#/alarms">${words.t('shelved')}: ${view.shelved.length}</a>` : nothing}
    </section>`;
  }
  const more = view.active.length - 1;
  const silent = SilentText(app, worst);
  return html`<section class="banner" data-urgency=${worst.urgency} data-phase=${worst.phase} aria-label=${words.t('alarm_bar')} role="alert">
    ${UrgencyIcon(worst.urgency)}
    <a class="what" href="#/alarms" data-key=${KeyOf(worst)}>
      <span class="cause"><b>${words.t(`urgency_${worst.urgency}`)}</b> ${words.cause(worst)}</span>
      <span class="response">${silent ? html`<em>${silent}</em> · ` : nothing}${worst.phase === 'unacknowledged' ? nothing : html`${words.of('phase_', worst.phase)} · `}${words.response(worst)}</span>
    </a>
    <span class="counts">
      ${URGENCIES.map((urgency) => view.counts[urgency]
        ? html`<span class="tally" title=${words.t(`urgency_${urgency}`)}>${UrgencyIcon(urgency)}<span class="sr">${words.t(`urgency_${urgency}`)}</span>×${view.counts[urgency]}</span>` : nothing)}
      ${more > 0 ? html`<a href="#/alarms">${words.t('alarm_more', {n: more})}</a>` : nothing}
    </span>
    ${AcknowledgeButton(app, worst)}
  </section>`;
}
