import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {AlarmsPage, EventsPage} from './alarms_page';
import {Attitude} from './attitude';
import {Banner} from './banner';
import {CameraPage, CameraPicture} from './camera';
import {Devices} from './devices';
import {DialogBody} from './dialogs';
import {Connection, Header, Navigation} from './header';
import {LoginForm} from './login';
import {Points} from './points';
import {NumberView} from './reading_view';
import {ReportsPage} from './reports_page';
import {SettingsPage} from './settings_page';
import type {Sizes} from './sizes';
import {StationPage} from './station_page';
import {Strips} from './strip';
import {Target} from './target';
import {TrolleyPage} from './trolley_page';

function DrivePage(app: App, sizes: Sizes): TemplateResult {
  const readings = app.readings();
  return html`<main class="page page-drive" id="content">
    <section class="facts">
      ${(['chainage', 'ring', 'stroke', 'speed'] as const).map((id) => {
        const reading = readings.get(id);
        return html`<div class="fact" data-fact=${id} data-quality=${reading?.judgement.quality ?? 'missing'}><span class="label">${reading?.label}</span>${NumberView(app, readings, id, {size: 'large', unit: true})}</div>`;
      })}
    </section>
    ${Target(app, readings)}
    ${Points(app, readings)}
    ${Attitude(app, readings)}
    ${Strips(app, readings, sizes)}
    ${CameraPicture(app, false)}
  </main>`;
}

function Notice(app: App): TemplateResult | typeof nothing {
  const {words} = app;
  const told = app.notice();
  if (!told) return nothing;
  const {asked, command} = told;
  const state = asked.fault ? 'failed' : command?.state ?? (asked.request_id ? 'sent' : 'sending');
  return html`<div class="notice" role="status" data-state=${state}>
    <b>${words.of('verb_', asked.request.verb)}</b> ${asked.request.argument}:
    ${asked.fault ? words.t('not_sent', {text: asked.fault}) : html`<b class="outcome" data-state=${state}>${words.of('state_', state)}</b> ${command?.text ?? ''}`}
  </div>`;
}

export function Page(app: App, sizes: Sizes): TemplateResult {
  const {words} = app;
  if (app.login !== 'in' && app.receipt === null) {
    return html`<main class="gate">${app.login === 'needed' ? LoginForm(app, false) : html`<h1>${words.t('title')}</h1>${Connection(app)}`}</main>`;
  }
  const body = {
    drive: () => DrivePage(app, sizes),
    alarms: () => AlarmsPage(app),
    events: () => EventsPage(app),
    camera: () => CameraPage(app),
    station: () => StationPage(app),
    trolley: () => TrolleyPage(app),
    reports: () => ReportsPage(app),
    settings: () => SettingsPage(app),
  }[app.route]();
  const isOpen = app.login === 'needed' || app.dialog !== null;
  return html`
    <div class="app" data-connection=${app.live.state} data-route=${app.route} data-down=${app.live.state === 'down'} data-shown-utc-ms=${app.sections.guidance?.timing.stamp_utc_ms ?? ''}>
      ${Header(app)}
      ${Navigation(app)}
      ${Banner(app)}
      ${body}
      ${Devices(app)}
      ${Notice(app)}
      ${app.isOldPage && (app.dialog || app.route === 'station') ? html`<div class="notice" role="status">${words.t('page_new')} <button type="button" class="act" @click=${() => location.reload()}>${words.t('page_load')}</button></div>` : nothing}
    </div>
    <dialog data-open=${isOpen} data-kind=${app.login === 'needed' ? 'login' : app.dialog?.kind ?? ''}
      aria-label=${app.login === 'needed' ? words.t('log_in') : words.t('detail')}
      @cancel=${(event: Event) => {
        event.preventDefault();
        app.open(null);
      }}
      @click=${(event: MouseEvent) => {
        if (event.target === event.currentTarget && app.login !== 'needed') app.open(null);
      }}>
      ${app.login === 'needed' ? LoginForm(app, true) : html`<div class="sheet">${DialogBody(app)}</div>`}
    </dialog>`;
}
