import {html, nothing, svg, type TemplateResult} from 'lit';

import {ROUTES, type App, type Route} from '../state/app';
import {ClockTime, Span} from '../state/format';
import {ElapsedSince} from '../state/freshness';
import {LANGUAGES} from '../state/settings';

// Strokes only: they must be told apart, not admired.
const ICONS: Record<Route, TemplateResult> = {
  drive: svg`<circle cx="12" cy="12" r="8"/><path d="M12 1v22M1 12h22"/>`,
  alarms: svg`<path d="M12 3l10 18H2z"/><path d="M12 9v6M12 17.5v1.5"/>`,
  events: svg`<path d="M3 5h18M3 12h18M3 19h12"/>`,
  camera: svg`<path d="M2 6h5l2-2h6l2 2h5v14H2z"/><circle cx="12" cy="13" r="4"/>`,
  station: svg`<path d="M12 12L5 22M12 12l7 10M12 12v10M8 3h8v7H8zM16 6h3"/>`,
  trolley: svg`<path d="M2 20h20M5 14h14l-2-7H7z"/><circle cx="8" cy="17" r="2"/><circle cx="16" cy="17" r="2"/>`,
  reports: svg`<path d="M5 2h10l4 4v16H5zM14 2v5h5"/><path d="M8 12h8M8 16h8"/>`,
  settings: svg`<path d="M3 6h10M19 6h2M3 12h2M11 12h10M3 18h8M17 18h4"/><circle cx="16" cy="6" r="2.5"/><circle cx="8" cy="12" r="2.5"/><circle cx="14" cy="18" r="2.5"/>`,
};

export function Navigation(app: App): TemplateResult {
  const {words} = app;
  const waiting = app.alarms().unacknowledged;
  return html`<nav class="rail" aria-label=${words.t('navigation')}>
    ${ROUTES.map((route) => html`<a href="#/${route}" data-route=${route} aria-current=${app.route === route ? 'page' : 'false'}>
      <svg viewBox="0 0 24 24" aria-hidden="true">${ICONS[route]}</svg>
      <span>${words.t(route)}</span>
      ${route === 'alarms' && waiting > 0 ? html`<b class="count">${waiting}</b>` : nothing}
    </a>`)}
  </nav>`;
}

export function Connection(app: App): TemplateResult {
  const {words, receipt, live} = app;
  if (!receipt) {
    const waited = ElapsedSince({at_utc_ms: 0, at_steady_ms: 0, ...app.started}, app.clocks());
    return waited < 1500
      ? html`<span class="connection" data-state="connecting">${words.t('connecting')}</span>`
      : html`<span class="connection" data-state="down"><span aria-hidden="true">✕</span> <b>${words.t('no_connection')}</b>
          <span>${words.t('no_connection_yet', {span: Span(waited)})}</span></span>`;
  }
  const elapsed = ElapsedSince(receipt, app.clocks());
  if (live.state !== 'live' || elapsed > 2000) {
    return html`<span class="connection" data-state="down"><span aria-hidden="true">✕</span> <b>${words.t('no_connection')}</b>
      <span>${words.t('no_connection_since', {time: ClockTime(receipt.at_utc_ms), span: Span(elapsed)})}</span></span>`;
  }
  const dds = app.sections.bridge?.dds;
  if (dds && !dds.running) {
    return html`<span class="connection" data-state="down"><span aria-hidden="true">✕</span> <b>${words.t('dds_down')}</b>
      <span>${words.t('since', {time: ClockTime(dds.since_utc_ms)})}</span></span>`;
  }
  return html`<span class="connection" data-state="live"><span aria-hidden="true">●</span> ${words.t('connected')}
    <span class="ago">${words.t('connected_ago', {span: Span(elapsed)})}</span></span>`;
}

function SoundButton(app: App): TemplateResult {
  const {words, settings, sound} = app;
  const muted_ms = app.muted_until_ms - performance.now();
  if (!settings.sound) {
    return html`<button type="button" class="sound" data-sound="off" @click=${() => app.change({sound: true})}>
      <span aria-hidden="true">🔇︎</span>${words.t('sound_off')}</button>`;
  }
  if (sound.isBlocked) {
    return html`<button type="button" class="sound" data-sound="blocked" title=${words.t('sound_blocked_long')} @click=${() => app.schedule(true)}>
      <span aria-hidden="true">!</span>${words.t('sound_blocked')}</button>`;
  }
  return html`<button type="button" class="sound" data-sound=${muted_ms > 0 ? 'muted' : 'on'} aria-pressed=${muted_ms > 0}
      title=${words.t('sound_mute')} @click=${() => app.mute()}>
    ${muted_ms > 0 ? words.t('sound_muted', {span: Span(muted_ms)}) : words.t('sound_on')}</button>`;
}

export function Header(app: App): TemplateResult {
  const {words, sections, settings, me} = app;
  const now = app.bridgeNow();
  const machine = sections.machine?.machine_id ?? sections.bridge?.machine_id ?? '';
  const isNight = app.theme() === 'night';
  const next = LANGUAGES[(LANGUAGES.indexOf(settings.language) + 1) % LANGUAGES.length] ?? 'en';
  return html`<header class="top">
    <h1 class="machine" title=${words.t('machine')}>${machine || '–'}</h1>
    <time class="clock" title=${words.t('clock')}>${ClockTime(now)}</time>
    ${Connection(app)}
    <span class="axis" title=${words.t('axis')}><small>${words.t('axis')}</small> ${sections.guidance?.axis_name ?? sections.machine?.axis_name ?? '–'}</span>
    <span class="grow"></span>
    <a class="user" href="#/settings" title=${words.t('user')}><span>${me?.name ?? ''}</span><small>${me ? words.of('role_', me.role) : ''}</small></a>
    <button type="button" class="theme" title=${words.t('theme')} @click=${() => app.change({theme: isNight ? 'day' : 'night'})}>
      <span aria-hidden="true">${isNight ? '☾' : '☼'}</span>${isNight ? words.t('night') : words.t('day')}</button>
    <button type="button" class="language" title=${words.t('language')} @click=${() => app.change({language: next})}>
      ${settings.language === 'zh' ? '中文' : settings.language.toUpperCase()}</button>
    ${SoundButton(app)}
  </header>`;
}
