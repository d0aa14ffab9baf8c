import {render} from 'lit';

import {App} from './state/app';
import {Page} from './view/page';
import {Sizes} from './view/sizes';

const root = document.getElementById('app') as HTMLElement;
const app = new App();
const sizes = new Sizes(() => app.schedule(true));

function Draw(): void {
  const page = document.documentElement;
  page.lang = app.settings.language === 'zh' ? 'zh-CN' : app.settings.language;
  page.dataset['theme'] = app.theme();
  document.title = `${app.sections.bridge?.machine_id ?? 'TBM'} · ${app.words.t('title')}`;
  render(Page(app, sizes), root);
  const dialog = root.querySelector('dialog');
  if (!dialog) return;
  const wanted = dialog.dataset['open'] === 'true';
  if (wanted && !dialog.open) dialog.showModal();
  if (!wanted && dialog.open) dialog.close();
}

app.run(Draw);
