// Chromium as the tests start it: no profile kept, no word to anybody.
import {chromium} from 'playwright-core';

export function OpenBrowser() {
  return chromium.launch({executablePath: process.env.TBM_CHROMIUM ?? '/usr/bin/chromium', headless: true, args: ['--headless', '--no-sandbox', '--disable-gpu', '--disable-quic',
    '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync', '--js-flags=--expose-gc', '--enable-precise-memory-info']});
}

export async function LogIn(page, url, settings = {}) {
  await page.addInitScript((kept) => {
    if (!localStorage.getItem('tbm.console.settings')) localStorage.setItem('tbm.console.settings', JSON.stringify(kept));
  }, {language: 'en', theme: 'day', ...settings});
  await page.goto(url);
  await page.fill('input[name=name]', 'keller');
  await page.fill('input[name=password]', 'right-password');
  await page.click('button[type=submit]');
  await page.waitForSelector('.app[data-connection=live]');
}
