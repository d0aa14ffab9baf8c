// Pictures of each state: node test/shots.mjs --dist FOLDER --shots FOLDER
import {mkdirSync} from 'node:fs';
import {join, resolve} from 'node:path';
import {parseArgs} from 'node:util';

import {LogIn, OpenBrowser} from './browser.mjs';
import {FakeBridge} from './fake_bridge.mjs';
import {SCENES} from './scenes.mjs';

const {values} = parseArgs({options: {dist: {type: 'string', default: 'dist'}, shots: {type: 'string', default: 'shots'}, only: {type: 'string', default: ''}}});
mkdirSync(values.shots, {recursive: true});
const PC = [1280, 800];
const SHOTS = [
  ['ok_day', 'ok', PC, {}], ['ok_night', 'ok', PC, {theme: 'night'}], ['degraded', 'degraded', PC, {}], ['coasting', 'coasting', PC, {}], ['stale', 'stale', PC, {}],
  ['missing', 'missing', PC, {}], ['missing_night', 'missing', PC, {theme: 'night'}], ['beyond', 'beyond', PC, {}], ['de_coasting', 'coasting', PC, {language: 'de'}], ['zh', 'coasting', PC, {language: 'zh', signs: 'steer'}], ['de', 'missing', PC, {language: 'de'}],
  ['de_steer_night', 'alarms', PC, {language: 'de', signs: 'steer', theme: 'night', angles: 'deg', chainage: 'internal'}],
  ['alarms', 'alarms', PC, {}, 'alarms'], ['alarms_zh', 'alarms', PC, {language: 'zh'}, 'alarms'], ['events', 'ok', PC, {}, 'events'], ['camera', 'degraded', PC, {}, 'camera'], ['settings', 'ok', PC, {}, 'settings'],
  ['station', 'move', PC, {}, 'station'], ['station_de', 'move', PC, {language: 'de'}, 'station'], ['station_night', 'ok', PC, {theme: 'night'}, 'station'],
  ['trolley', 'ok', PC, {}, 'trolley'], ['trolley_open_de', 'trolley_open', PC, {language: 'de'}, 'trolley'], ['trolley_none_zh_night', 'trolley_none', PC, {language: 'zh', theme: 'night'}, 'trolley'],
  ['no_connection', 'ok', PC, {}], ['detail', 'coasting', PC, {}], ['shelve', 'alarms', PC, {}, 'alarms'], ['login', 'ok', PC, {}],
  ['tablet_landscape', 'ok', [1024, 768], {}], ['tablet_portrait', 'alarms', [768, 1024], {language: 'de'}], ['large', 'ok', [1920, 1080], {}],
];
const bridge = new FakeBridge({dist: resolve(values.dist)});
const url = await bridge.start();
const browser = await OpenBrowser();
for (const [name, scene, [width, height], settings, route] of SHOTS) {
  if (values.only && !values.only.split(',').includes(name)) continue;
  bridge.reset();
  const context = await browser.newContext({viewport: {width, height}});
  const page = await context.newPage();
  if (name === 'login') {
    await page.goto(url);
    await page.waitForSelector('form.login');
  } else {
    await LogIn(page, `${url}/#/${route ?? 'drive'}`, settings);
    SCENES[scene](bridge);
    if (name === 'no_connection') {
      bridge.is_deaf = true;
      bridge.cut();
      await page.waitForTimeout(3500);
    }
    if (name === 'detail') await page.click('[data-id="point.cutter_face.right"].huge');
    if (name === 'shelve') await page.click('.alarm .shelve');
    await page.waitForTimeout(500);
  }
  await page.screenshot({path: join(values.shots, `${name}.png`), fullPage: width < 1200 && height > 900});
  await context.close();
}
await browser.close();
await bridge.stop();
if (bridge.faults.length) console.error('against the contract:', bridge.faults[0]);
