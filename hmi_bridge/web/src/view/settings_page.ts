import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {DateTime} from '../state/format';
import {BEHIND_CHOICES_M, LANGUAGES, type Settings} from '../state/settings';
import {LANGUAGE_NAMES} from '../text/index';

function Choice<K extends keyof Settings>(app: App, key: K, title: string, choices: readonly (readonly [Settings[K], string])[]): TemplateResult {
  return html`<fieldset data-setting=${key}><legend>${title}</legend>
    ${choices.map(([value, text]) => html`<button type="button" data-value=${String(value)} aria-pressed=${app.settings[key] === value}
      @click=${() => app.change({[key]: value} as Partial<Settings>)}><span aria-hidden="true">${app.settings[key] === value ? '◉' : '○'}</span> ${text}</button>`)}
  </fieldset>`;
}

export function SettingsPage(app: App): TemplateResult {
  const {words, me, sections} = app;
  return html`<main class="page page-settings" id="content">
    <section class="panel"><h2>${words.t('screen_settings')}</h2>
      ${Choice(app, 'language', words.t('language'), LANGUAGES.map((one) => [one, LANGUAGE_NAMES[one]] as const))}
      ${Choice(app, 'theme', words.t('theme'), [['day', words.t('day')], ['night', words.t('night')], ['auto', words.t('theme_auto')]])}
      ${Choice(app, 'signs', words.t('signs'), [['machine', words.t('signs_machine')], ['steer', words.t('signs_steer')]])}
      ${Choice(app, 'angles', words.t('angles'), [['mm_per_m', words.t('angles_mm_per_m')], ['deg', words.t('angles_deg')]])}
      ${Choice(app, 'chainage', words.t('chainage_shown'), [['official', words.t('official')], ['internal', words.t('internal')]])}
      ${Choice(app, 'behind_m', words.t('look_back'), BEHIND_CHOICES_M.map((m) => [m, `${m} m`] as const))}
      ${Choice(app, 'sound', words.t('sound'), [[true, words.t('sound_on')], [false, words.t('sound_off')]])}
      <p class="row"><button type="button" class="act quiet" @click=${() => {
        app.sound.unlock();
        app.sound.play('high');
      }}>${words.t('sound_try')}</button>${app.sound.isBlocked ? html` <span>${words.t('sound_blocked_long')}</span>` : nothing}</p>
    </section>
    <section class="panel"><h2>${words.t('user')}</h2>
      <p class="row"><b>${me?.name ?? ''}</b> ${me ? words.of('role_', me.role) : ''}
        <button type="button" class="act quiet logout" @click=${() => void app.logOut()}>${words.t('log_out')}</button></p>
      <h2>${words.t('about')}</h2>
      <p>${words.t('version')} ${sections.bridge?.version ?? '–'}, ${app.page_build}</p>
      <p>DDS ${sections.bridge?.dds.domain ?? '–'}, ${DateTime(sections.bridge?.started_at_utc_ms ?? null)}</p>
    </section>
  </main>`;
}
