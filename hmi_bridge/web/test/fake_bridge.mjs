// A bridge for tests: serves the built page with the real one's CSP and speaks the contract from states
// that a script sets. `node test/fake_bridge.mjs --dist FOLDER` runs it by itself, to look at the page.
import {readFileSync} from 'node:fs';
import {createServer} from 'node:http';
import {extname, join, normalize} from 'node:path';
import {fileURLToPath} from 'node:url';
import {parseArgs} from 'node:util';

import Ajv2020 from 'ajv/dist/2020.js';
import {WebSocketServer} from 'ws';
import {parse} from 'yaml';

export const CSP = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; connect-src 'self'; " +
  "media-src 'self' data:; manifest-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'";
const TYPES = {'.html': 'text/html; charset=utf-8', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml'};
const contract = parse(readFileSync(new URL('../../openapi.yaml', import.meta.url), 'utf8'));

const POINTS = [['cutter_face', 'front', 6.8, -13.2, 12.5, 2.2, 1.2], ['front', 'front', 6, -13.1, 13.9, 2.1, 1.1],
  ['articulation', 'front', 1, -12.8, 23.2, 1.3, 0.8], ['rear', 'rear', 0, -5.5, 13.0, 1.2, 0.6], ['tail', 'rear', -5, 7.0, 4.0, 1.0, 0.6]];
const LEDS = ['L1', 'L2', 'L3', 'L4', 'L5', 'L6'];
const clone = (value) => JSON.parse(JSON.stringify(value));

function alarm(code, urgency, more = {}) {
  return {source: 'guidance', code, origin: 'process', phase: 'unacknowledged', urgency, since_utc_ms: null, raised_at_utc_ms: null,
    times_raised: 1, value: null, raise_above: null, clear_below: null, unit: '', cause: '', response: '', acknowledged_by: '',
    shelved_until_utc_ms: null, shelved_by: '', shelved_because: '', silent_since_utc_ms: null, ...more};
}
export {alarm};

export class FakeBridge {
  constructor({dist, role = 'surveyor', utc_ms = Date.now()}) {
    this.dist = dist;
    this.role = role;
    this.skew_ms = utc_ms - Date.now();  // of the bridge's clock
    this.sessions = new Set();
    this.audit = [];
    this.sockets = new Set();
    this.held = new Set();  // sections that nobody renews
    this.is_mute = false;  // connected, and says nothing
    this.is_deaf = false;  // refuses sockets
    this.period_ms = 100;
    this.number = 0;
    this.chainage_m = 2060.0;
    this.login_status = 0;
    this.sections = this.make();
    const ajv = new Ajv2020({strict: false, allErrors: true});
    ajv.addSchema({$id: 'contract', components: contract.components});
    this.validate = ajv.compile({$ref: 'contract#/components/schemas/Snapshot'});
    this.faults = [];
  }

  utc() { return Date.now() + this.skew_ms; }
  steady() { return performance.now(); }
  timing(stale_after_ms = 1000) { return {stamp_utc_ms: this.utc() - 20, heard_steady_ms: this.steady() - 5, stale_after_ms}; }

  make() {
    const utc = this.utc();
    const shield = (roll_deg, pitch_deg) => ({timing: this.timing(), validity: 'valid', reason: '', age_s: 12.3, heading_deg: 39.9964, pitch_deg, roll_deg,
      heading_sigma_deg: 0.01, pitch_sigma_deg: 0.008, roll_sigma_deg: 0.006, speed_mm_per_min: 42.4, speed_sigma_mm_per_min: 1.8, position_in_site_m: [1042.412, 5050.565, 99.024]});
    const device = (id) => ({id, timing: this.timing(3000), state: 'streaming', since_utc_ms: utc - 3.6e6, samples_good: 4965, samples_lost: 0, errors: 0, reconnects: 0, detail: ''});
    return {
      bridge: {version: '0.5.0', page_build: this.pageBuild(), machine_id: 'TBM-1', started_at_utc_ms: utc - 7.2e6, dds: {domain: 25, running: true, since_utc_ms: utc - 7.2e6}},
      machine: {machine_id: 'TBM-1', axis_name: 'Main tunnel', axis_start_m: 0, axis_end_m: 4200, steer_by: 'cutter_face', deviation_limit_mm: 50, predicted_limit_mm: 80,
        sigma_limit_mm: 15, roll_limit_deg: 1, useful_sigma_mm: 25, image_width_px: 1280, image_height_px: 1024, leds: LEDS,
        points: POINTS.map(([name, s]) => ({name, shield: s})), ring_length_mm: 1500, calibrations: [],
        axis: Array.from({length: 141}, (_, i) => ({chainage_m: 1900 + i * 5, bearing_deg: 40, curvature_per_km: i * 5 + 1900 < 2080 ? 0 : Math.min(2, (i * 5 + 1900 - 2080) / 20), gradient_percent: i * 5 + 1900 < 2120 ? -1.35 : -0.8, height_m: 100 - i * 0.06}))},
      guidance: {timing: this.timing(), number: 1, validity: 'valid', reason: '', steer_by: 'cutter_face', axis_name: 'Main tunnel', axis_sha256: 'a'.repeat(64), machine_sha256: 'b'.repeat(64), set_up_number: 4,
        lead_right_mm_per_m: -0.1, lead_up_mm_per_m: -1.9, lead_right_sigma_mm_per_m: 0.3, lead_up_sigma_mm_per_m: 0.1,
        articulation_right_deg: 0.138, articulation_up_deg: -0.206, articulation_roll_deg: -0.052, articulation_right_sigma_deg: 0.017, articulation_up_sigma_deg: 0.006, articulation_roll_sigma_deg: 0.006,
        stroke_mm: 812.4, stroke_sigma_mm: 0.6, ring_number: 40, prisms: {used: 4, chi2: 4.1, dof: 6, rms_mm: 0.3, remark: ''},
        sources: [['station', 12], ['camera', 0.1], ['tilt_target', 0.1], ['tilt_camera', 0.1]].map(([name, age_s]) => ({name, freshness: 'fresh', age_s, reason: ''})),
        points: POINTS.map(([name, s, ahead, right, up, rs, us]) => ({name, shield: s, validity: 'valid', reason: '', right_mm: right, up_mm: up, right_sigma_mm: rs, up_sigma_mm: us, correlation: 0.2,
          chainage_m: this.chainage_m + ahead, official_chainage_m: this.chainage_m + ahead + 10000, official_section: 0, chainage_sigma_mm: 1.4,
          trend_right_mm_per_m: 0.4, trend_up_mm_per_m: -0.9, trend_right_sigma_mm_per_m: 0.3, trend_up_sigma_mm_per_m: 0.3, trend_length_m: 5, position_in_site_m: [1042, 5050, 99], position_sigma_mm: 2.6})),
        ahead: [[1, 2.3], [2, 2.8], [5, 6.9], [10, 14.5], [15, 24], [20, 35]].map(([m, sigma]) => ({ahead_m: m, right_mm: -13.2 - 0.1 * m, up_mm: 12.5 - 2.0 * m, right_sigma_mm: sigma, up_sigma_mm: sigma * 0.9}))},
      shields: {front: shield(-0.155, -0.968), rear: shield(-0.103, -0.756)},
      camera: {
        pose: {timing: this.timing(), status: 'ok', reason: '', leds_used: 6, excluded_led: null, tilts_used: true, chi2: 5, dof: 8, rms_px: 0.07, rig_sha256: 'c'.repeat(64), points: [{name: 'shield_head', in_camera_mm: [-0.3, 1.2, 4909.3], sigma_mm: 0.9, bound_mm: 3.7}]},
        frame: {timing: this.timing(), number: 999, reason: '', exposure_us: 800, background_dn: 9.8, noise_dn: 1.2, rejected_spots: 1, dropped_spots: 0, received: 999, lost: 0, damaged: 0, skipped: 0,
          spots: [...LEDS.map((led, i) => ({u_px: 640 + 330 * Math.cos(i * 1.05), v_px: 512 + 300 * Math.sin(i * 1.05), sigma_px: 0.03, peak_dn: 210 - i * 9, led, residual_u_px: 0.06 * Math.sin(i * 2), residual_v_px: 0.07 * Math.cos(i * 3)})),
            {u_px: 1120, v_px: 180, sigma_px: 0.1, peak_dn: 60, led: null, residual_u_px: null, residual_v_px: null}]}},
      tilts: ['target', 'camera'].map((sensor) => ({sensor, timing: this.timing(), validity: 'valid', reason: '', beta_deg: -0.15, gamma_deg: -0.97, sigma_deg: 0.005})),
      station: {in_use: this.setUp(4, 'good', ''), proposed: {...this.setUp(0, 'none', 'none_proposed'), references: []}, previous: this.setUp(3, 'suspect', 'superseded'),
        observations: ['RS1', 'RS2', 'RS3', 'RS4', 'R11'].map((target, i) => ({target, kind: target[1] === 'S' ? 'prism' : 'reference', face: 1, status: i === 3 ? 'none' : 'good', reason: i === 3 ? 'no_target' : '', at_utc_ms: utc - 4000 * i, slope_m: i === 3 ? null : 38.4 + i, position_in_site_m: i === 3 ? null : [1030, 5040, 100]}))},
      devices: ['camera', 'inclinometer_target', 'inclinometer_camera', 'TS-1', 'guidance', 'journal'].map(device),
      alarms: {list: [], first_out: null},
      events: [{source: 'total_station', code: 'set_up', at_utc_ms: utc - 53000, severity: 'info', active: false, text: 'set up as number 4, sigma 0.5 mm in the worst coordinate'},
        {source: 'camera', code: 'device_state', at_utc_ms: utc - 100000, severity: 'info', active: false, text: 'camera is streaming'}],
      commands: [],
      reports: [],
      trolley: {
        state: {timing: this.timing(400), run: 'rail_20261123_101500', status: 'fixed', reason: '', position_world_m: [1.2342, 12.8871, 1.1998], position_sigma_mm: [0.21, 0.34, 0.18], speed_m_per_s: 0.271,
          distance_m: 34.52, target_age_s: 0.2, tilt_age_s: 0.1, rest_age_s: 128.4, came_too_late: 0, gaps: 0},
        settlement: {base_run: 'rail_20260301_090000', later_run: 'rail_20261120_101500', at_utc_ms: utc - 2.6e8, highest_alert: 0}},
    };
  }

  setUp(number, state, reason) {
    const has = state !== 'none';
    return {timing: this.timing(3000), station: 'TS-1', set_up_number: number, state, reason, set_up_at_utc_ms: has ? this.utc() - 3.1e6 : null, last_good_check_at_utc_ms: has ? this.utc() - 58000 : null,
      position_in_site_m: has ? [1017.8318, 5017.6728, 101.625] : null, position_sigma_mm: has ? [0.5, 0.5, 0.4] : null, circle_zero_bearing_deg: has ? 12.3456 : null, circle_zero_sigma_deg: has ? 0.0006 : null,
      chi2: has ? 9.1 : null, dof: has ? 11 : null, sees_mm: has ? 1.8 : null, closure_mm: null, closure_worst_mm: null, closure_tolerance_mm: null, closure_points: 0,
      references: ['R11', 'R12', 'R13', 'R14', 'R15', 'K16'].map((name, i) => ({name, used: i < 5 && i !== 3, reason: i === 3 ? 'moved' : i === 5 ? 'control' : '', across_mm: [0.3, -0.5, 0.2, 4.1, -0.1, 0.6][i], up_mm: [-0.2, 0.4, 0.1, -2.2, -0.3, 0.5][i],
        slope_mm: [0.4, -0.1, 0.3, 1.2, -0.6, 0.2][i], standardised: [0.6, 1.0, 0.4, 6.3, 0.7, 1.1][i], checked_share: 0.6, position_in_site_m: [1000 + i, 5000, 100]}))};
  }

  pageBuild() {
    try {
      return readFileSync(join(this.dist, 'index.html'), 'utf8').match(/name="page-build" content="([^"]+)"/)[1];
    } catch {
      return 'none';
    }
  }

  async start(port = 0) {
    this.server = createServer((request, response) => this.serve(request, response));
    this.ws = new WebSocketServer({noServer: true, handleProtocols: (offered) => (offered.has('tbm.console.v1') ? 'tbm.console.v1' : false)});
    this.server.on('upgrade', (request, socket, head) => {
      if (this.is_deaf) return socket.destroy();
      if (!this.session(request)) return socket.end('HTTP/1.1 401 Unauthorized\r\nContent-Length: 0\r\n\r\n');
      this.ws.handleUpgrade(request, socket, head, (client) => {
        this.sockets.add(client);
        client.on('close', () => this.sockets.delete(client));
        client.count = 0;
        this.send(client, this.sections);
      });
    });
    await new Promise((resolve) => this.server.listen(port, '127.0.0.1', resolve));
    this.port = this.server.address().port;
    this.timer = setInterval(() => this.step(), this.period_ms);
    return `http://127.0.0.1:${this.port}`;
  }

  async stop() {
    clearInterval(this.timer);
    for (const client of this.sockets) client.terminate();
    this.ws.close();
    this.server.closeAllConnections();
    await new Promise((resolve) => this.server.close(resolve));
  }

  // All that is not held is of now.
  step() {
    const fresh = (part, stale) => part && Object.assign(part.timing, this.timing(stale));
    const {sections, held} = this;
    const changed = {};
    if (!held.has('guidance') && sections.guidance) {
      fresh(sections.guidance);
      sections.guidance.number += 1;
      for (const point of sections.guidance.points) {
        if (point.chainage_m !== null) {
          point.chainage_m += this.advance_m ?? 0.00007;
          point.official_chainage_m = point.chainage_m + 10000;
        }
      }
      changed.guidance = sections.guidance;
    }
    if (!held.has('shields')) { fresh(sections.shields.front); fresh(sections.shields.rear); changed.shields = sections.shields; }
    if (!held.has('trolley') && sections.trolley.state) { fresh(sections.trolley.state, 400); changed.trolley = sections.trolley; }
    if (!held.has('camera')) { fresh(sections.camera.pose); fresh(sections.camera.frame); changed.camera = sections.camera; }
    if (!held.has('devices')) for (const device of sections.devices) if (!held.has(device.id)) fresh(device, 3000);
    if (!held.has('station')) for (const role of ['in_use', 'proposed', 'previous']) fresh(sections.station[role], 3000);
    this.number += 1;
    if (this.number % 10 === 0) Object.assign(changed, {devices: sections.devices, station: sections.station, alarms: sections.alarms});
    this.publish(changed);
  }

  publish(sections) {
    if (this.is_mute) return;
    for (const client of this.sockets) this.send(client, sections);
  }

  send(client, sections) {
    if (this.is_mute) return;
    client.count += 1;
    const snapshot = {number: client.count, at_utc_ms: this.utc(), at_steady_ms: this.steady(), sections};
    if (client.count % 20 === 1 && !this.validate(clone(snapshot))) this.faults.push(JSON.stringify(this.validate.errors.slice(0, 3)));
    client.send(JSON.stringify(snapshot));
  }

  set(change) {
    change(this.sections);
    this.publish(this.sections);
  }

  reset() {
    this.held.clear();
    this.is_mute = this.is_deaf = false;
    this.skew_ms = 0;
    this.advance_m = undefined;
    this.sections = this.make();
    this.publish(this.sections);
  }

  cut() { for (const client of this.sockets) client.terminate(); }

  session(request) {
    const token = /tbm_session=(\w+)/.exec(request.headers.cookie ?? '')?.[1];
    return token && this.sessions.has(token) ? token : null;
  }

  async serve(request, response) {
    const {pathname, searchParams} = new URL(request.url, 'http://x');
    const json = (status, body, headers = {}) => response.writeHead(status, {'Content-Type': 'application/json', 'Content-Security-Policy': CSP, ...headers}).end(status === 204 ? undefined : JSON.stringify(body));
    const no = (status, error, text, headers) => json(status, {error, text}, headers);
    let body = {};
    if (request.method === 'POST') {
      let text = '';
      for await (const part of request) text += part;
      body = JSON.parse(text || '{}');
    }
    const me = {name: 'keller', role: this.role, expires_at_utc_ms: this.utc() + 4.3e7};
    if (!pathname.startsWith('/api/')) {
      const file = normalize(join(this.dist, pathname === '/' ? 'index.html' : pathname));
      try {
        const bytes = readFileSync(file.startsWith(normalize(this.dist)) ? file : '');
        response.writeHead(200, {'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream', 'Content-Security-Policy': CSP, 'X-Content-Type-Options': 'nosniff'}).end(bytes);
      } catch {
        response.writeHead(404).end();
      }
      return;
    }
    if (pathname === '/api/login') {
      if (this.login_status === 429) return no(429, 'too_many', 'too many attempts', {'Retry-After': '10'});
      if (body.password !== 'right-password') return no(401, 'wrong_password', 'name or password is wrong');
      const token = Math.random().toString(36).slice(2);
      this.sessions.add(token);
      return json(200, me, {'Set-Cookie': `tbm_session=${token}; HttpOnly; SameSite=Strict; Path=/`});
    }
    const token = this.session(request);
    if (!token) return no(401, 'not_logged_in', 'log in first');
    if (pathname === '/api/me') return json(200, me);
    if (pathname === '/api/logout') {
      this.sessions.delete(token);
      this.cut();
      return json(204);
    }
    if (pathname === '/api/advance') return json(200, this.history(searchParams.get('point'), Number(searchParams.get('length_m'))));
    if (pathname === '/api/commands') return this.command(body, json, no);
    return no(404, 'not_found', 'no such thing');
  }

  history(point, length_m) {
    const end = this.sections.guidance?.points.find((one) => one.name === point)?.chainage_m ?? this.chainage_m;
    const rows = Array.from({length: Math.round(length_m / 0.05)}, (_, i) => end - length_m + i * 0.05);
    const columns = {at_utc_ms: rows.map((_, i) => this.utc() - (rows.length - i) * 1000), chainage_m: rows,
      right_mm: rows.map((m) => (m > end - 22 && m < end - 20 ? null : -13.2 + 14 * Math.sin((end - m) / 9) * Math.min(1, (end - m) / 3))), up_mm: rows.map((m) => 12.5 - 11 * Math.sin((end - m) / 12)),
      right_sigma_mm: rows.map(() => 2), up_sigma_mm: rows.map(() => 1.2), validity: rows.map(() => 'valid')};
    return {point, columns};
  }

  // Every command is answered: those of `refuse` with a sentence.
  command(body, json, no) {
    this.audit.push(body);
    if (this.role === 'viewer') return no(403, 'forbidden', 'viewers may not');
    const request_id = `r${this.audit.length}`;
    const {list} = this.sections.alarms;
    const found = list.find((one) => body.argument.split(' ')[0] === (one.origin === 'process' ? one.code : `${one.source}/${one.code}`));
    const command = {request_id, addressee: body.addressee, verb: body.verb, argument: body.argument, by: 'keller', because: body.because, issued_at_utc_ms: this.utc(), state: 'sent', text: ''};
    this.set((s) => { s.commands = [command, ...s.commands].slice(0, 30); });
    setTimeout(() => this.set((s) => {
      command.state = this.refuse ? 'refused' : 'done';
      command.text = this.refuse ?? '';
      if (found && !this.refuse) {
        if (body.verb === 'acknowledge') Object.assign(found, {phase: 'acknowledged', acknowledged_by: 'keller'});
        if (body.verb === 'shelve') Object.assign(found, {shelved_until_utc_ms: this.utc() + 60000 * Number(body.argument.split(' ')[1]), shelved_by: 'keller', shelved_because: body.because});
        if (body.verb === 'unshelve') Object.assign(found, {shelved_until_utc_ms: null, shelved_by: '', shelved_because: ''});
      }
      if (body.verb === 'pause') Object.assign(s.station.in_use, {state: 'suspect', reason: 'station_moving'});
      if (body.verb === 'propose_move') s.station.proposed = {...this.setUp(5, 'good', ''), closure_mm: [0.8, -0.6, 0.3], closure_worst_mm: 1.6, closure_tolerance_mm: 3, closure_points: 5};
    }), 60);
    return json(202, {request_id});
  }
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const {values} = parseArgs({options: {dist: {type: 'string', default: 'dist'}, port: {type: 'string', default: '8090'}}});
  const bridge = new FakeBridge({dist: values.dist});
  console.log(`${await bridge.start(Number(values.port))}, password: right-password`);
}
