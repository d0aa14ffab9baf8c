import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {LANGUAGES} from '../state/settings';
import {LANGUAGE_NAMES} from '../text/index';

export function LoginForm(app: App, isAgain: boolean): TemplateResult {
  const {words} = app;
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    const form = new FormData(event.target as HTMLFormElement);
    void app.logIn(String(form.get('name') ?? '').trim(), String(form.get('password') ?? ''));
  };
  return html`<form class="login" @submit=${submit}>
    <h1>${words.t('title')}</h1>
    <p>${isAgain ? words.t('login_again') : words.t('login_lead')}</p>
    <label>${words.t('name')}<input name="name" autocomplete="username" autocapitalize="none" required maxlength="32"></label>
    <label>${words.t('password')}<input name="password" type="password" autocomplete="current-password" required maxlength="200"></label>
    <p class="fault" role="alert">${app.login_fault ? html`<span aria-hidden="true">▲</span> ${app.login_fault}` : nothing}</p>
    <button type="submit" class="act" ?disabled=${app.is_logging_in}>${words.t('log_in')}</button>
    ${isAgain ? nothing : html`<p class="languages">${LANGUAGES.map((one) => html`<button type="button" class="quiet" aria-pressed=${app.settings.language === one}
      @click=${() => app.change({language: one})}>${LANGUAGE_NAMES[one]}</button>`)}</p>`}
  </form>`;
}
