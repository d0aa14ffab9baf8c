// A day of the page in minutes: 864 000 messages (10 Hz), 30 m of advance, an event each minute, an alarm each five,
// as fast as the page takes them. Its heap and its elements are looked at after each twelfth of the day.
//
//   node test/day.mjs --dist FOLDER [--messages 864000]
//
// Its last line is "N passed, N failed".
import {resolve} from 'node:path';
import {parseArgs} from 'node:util';

import {LogIn, OpenBrowser} from './browser.mjs';
import {FakeBridge} from './fake_bridge.mjs';

const kMost_bytes_a_message = 5;  // 4 MB a day
const {values} = parseArgs({options: {dist: {type: 'string', default: 'dist'}, messages: {type: 'string', default: '864000'}}});
const messages = Number(values.messages);
const bridge = new FakeBridge({dist: resolve(process.env.INIT_CWD ?? process.cwd(), values.dist)});
const url = await bridge.start();
const browser = await OpenBrowser();
const page = await browser.newPage({viewport: {width: 1280, height: 800}});
await LogIn(page, url);

const Look = () => page.evaluate(() => {
  window.gc?.();
  window.gc?.();
  return {heap_mb: performance.memory.usedJSHeapSize / 1e6, elements: document.querySelectorAll('*').length};
});
// What the page has taken: it answers when it has come to the end of what was sent.
const TakenUpTo = () => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => done())));

const looks = [];
const begun = performance.now();
for (let i = 1; i <= messages; ++i) {
  bridge.advance_m = 30 / messages;
  bridge.step();
  if (i % 600 === 0) {
    bridge.set((s) => {
      s.events = [{source: 'camera_box', code: `event_${i}`, at_utc_ms: bridge.utc(), severity: 'info', active: false, text: `event ${i}`}, ...s.events].slice(0, 60);
    });
  }
  if (i % 20 === 0) await new Promise((done) => setTimeout(done, 0));
  if (i % 400 === 0) await TakenUpTo();
  if (i % Math.floor(messages / 12) === 0) {
    await page.waitForTimeout(300);
    looks.push({messages: i, ...(await Look())});
    const {heap_mb, elements} = looks.at(-1);
    console.log(`${i} messages, ${((performance.now() - begun) / 1000).toFixed(0)} s: ${heap_mb.toFixed(2)} MB, ${elements} elements`);
  }
}
await browser.close();
await bridge.stop();

// The first looks are those of rings that fill up.
const [first, last] = [looks[3], looks.at(-1)];
const growth_bytes = ((last.heap_mb - first.heap_mb) * 1e6) / (last.messages - first.messages);
const is_flat = growth_bytes < kMost_bytes_a_message;
const is_bounded = looks.every((look) => look.elements < 2000);
console.log(`${is_flat ? 'ok   ' : 'FAIL '} heap: ${growth_bytes.toFixed(2)} bytes a message, ${((growth_bytes * 864000) / 1e6).toFixed(1)} MB a day at 10 Hz`);
console.log(`${is_bounded ? 'ok   ' : 'FAIL '} elements: ${Math.max(...looks.map((look) => look.elements))} at most`);
console.log(`${Number(is_flat) + Number(is_bounded)} passed, ${Number(!is_flat) + Number(!is_bounded)} failed`);
process.exit(is_flat && is_bounded ? 0 : 1);
