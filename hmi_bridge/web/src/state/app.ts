// The state of the open page, and what may be done with it. Views read it, actions change it.
import {Words, WordsFor} from '../text/index';
import {ViewOf, SoundFor, type AlarmView} from './alarms';
import {api} from './api';
import {BridgeNow, type ReaderClocks, type Receipt} from './freshness';
import {Live, type Socket} from './live';
import {ReadingsOf, SteerPoint, type Readings} from './readings';
import {KeepSettings, LoadSettings, ThemeAt, type Settings} from './settings';
import {Sound} from './sound';
import {Track} from './track';
import type {Alarm, Command, CommandRequest, Me, Role, Sections, Snapshot, Urgency} from './types';

export const ROUTES = ['drive', 'alarms', 'events', 'camera', 'station', 'trolley', 'reports', 'settings'] as const;
export type Route = (typeof ROUTES)[number];

export type Dialog =
  | {kind: 'reading'; id: string}
  | {kind: 'device'; id: string}
  | {kind: 'source'; name: string}
  | {kind: 'alarm'; verb: 'acknowledge' | 'shelve' | 'unshelve'; alarm: Alarm; minutes: number; fault: string}
  | {kind: 'confirm'; text: string; request: CommandRequest};

// A command of this page, from the tap to the addressee's last word.
export interface Asked {
  request: CommandRequest;
  request_id: string | null;
  fault: string;  // why it was not sent
  opened_ms: number;
  asked_ms: number;  // of the last word
}

const MUTE_MS = 120_000;
const NOTICE_MS = 10_000;
const OPEN_NOTICE_MS = 60_000;
const RENDER_EVERY_MS = 80;
const TICK_MS = 250;
const RELOAD_KEY = 'tbm.console.reloaded_for';

function LocalStore(): Storage | null {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}

export class App {
  sections: Partial<Sections> = {};
  receipt: Receipt | null = null;
  me: Me | null = null;
  login: 'unknown' | 'needed' | 'in' = 'unknown';
  login_fault = '';
  is_logging_in = false;
  settings: Settings;
  words: Words;
  route: Route = 'drive';
  dialog: Dialog | null = null;
  asked: Asked | null = null;
  muted_until_ms = 0;
  has_history = true;
  target_scale_mm: number | null = null;
  move_fault = '';
  readonly track = new Track();
  readonly sound = new Sound();
  readonly live: Live;
  readonly started: ReaderClocks;
  readonly page_build: string;
  private render: () => void = () => undefined;
  private frame_pending = false;
  private rendered_ms = -Infinity;
  private fetching = '';

  constructor() {
    this.settings = LoadSettings(LocalStore(), navigator.language);
    this.words = WordsFor(this.settings);
    this.started = this.clocks();
    this.page_build = document.querySelector<HTMLMetaElement>('meta[name="page-build"]')?.content ?? '';
    this.live = new Live(
      {
        open: () => OpenSocket(),
        isLoggedIn: async () => {
          const answer = await api.me();
          if (!answer.ok && answer.status !== 401) throw new Error(answer.text);
          return answer.ok;
        },
        now: () => Math.max(performance.now(), 0),
        after: (ms, what) => {
          const timer = setTimeout(what, ms);
          return () => clearTimeout(timer);
        },
      },
      {
        snapshot: (snapshot) => this.take(snapshot),
        changed: () => this.schedule(),
        loggedOut: () => {
          this.login = 'needed';
          this.schedule();
        },
      },
    );
  }

  run(render: () => void): void {
    this.render = render;
    this.readRoute();
    addEventListener('hashchange', () => this.readRoute());
    addEventListener('pointerdown', () => this.sound.unlock());
    addEventListener('keydown', () => this.sound.unlock());
    setInterval(() => this.tick(), TICK_MS);
    void this.enter();
  }

  clocks(): ReaderClocks {
    return {performance_ms: performance.now(), date_ms: Date.now()};
  }

  bridgeNow(): number | null {
    return this.receipt && BridgeNow(this.receipt, this.clocks());
  }

  get isDown(): boolean {
    return this.live.state !== 'live';
  }

  readings(): Readings {
    return ReadingsOf({sections: this.sections, receipt: this.receipt, now: this.clocks(), settings: this.settings, words: this.words});
  }

  alarms(): AlarmView {
    return ViewOf(this.sections.alarms?.list ?? [], this.bridgeNow() ?? 0);
  }

  wantedSound(): Urgency | null {
    return SoundFor(this.sections.alarms?.list ?? [], {
      sound: this.settings.sound,
      muted_until_ms: this.muted_until_ms,
      bridge_now_ms: this.bridgeNow() ?? 0,
      now_ms: performance.now(),
      is_down: this.live.state === 'down' && this.login === 'in' && this.receipt !== null,
    });
  }

  theme(): 'day' | 'night' {
    return ThemeAt(this.settings.theme, new Date(this.bridgeNow() ?? Date.now()).getHours());
  }

  may(role: Role): boolean {
    const order: Role[] = ['viewer', 'operator', 'surveyor'];
    return this.me !== null && order.indexOf(this.me.role) >= order.indexOf(role);
  }

  // Drawn at once when the last picture is old enough, otherwise as soon as it is.
  schedule(isTouch = false): void {
    if (this.frame_pending) return;
    this.frame_pending = true;
    const draw = () => {
      this.frame_pending = false;
      this.rendered_ms = performance.now();
      this.render();
    };
    const wait = isTouch ? 0 : RENDER_EVERY_MS - (performance.now() - this.rendered_ms);
    if (wait <= 0) requestAnimationFrame(draw);
    else setTimeout(() => requestAnimationFrame(draw), wait);
  }

  change(settings: Partial<Settings>): void {
    this.settings = {...this.settings, ...settings};
    this.words = WordsFor(this.settings);
    KeepSettings(LocalStore(), this.settings);
    if (settings.behind_m !== undefined) this.fetching = '';
    this.schedule(true);
  }

  open(dialog: Dialog | null): void {
    this.dialog = dialog;
    this.schedule(true);
  }

  mute(): void {
    this.muted_until_ms = performance.now() < this.muted_until_ms ? 0 : performance.now() + MUTE_MS;
    this.schedule(true);
  }

  async logIn(name: string, password: string): Promise<void> {
    this.is_logging_in = true;
    this.schedule(true);
    const answer = await api.login(name, password);
    this.is_logging_in = false;
    const {words} = this;
    if (answer.ok) {
      this.me = answer.value;
      this.login = 'in';
      this.login_fault = '';
      this.live.start();
    } else if (answer.status === 401) {
      this.login_fault = words.t('login_wrong');
    } else if (answer.status === 429 || answer.status === 503) {
      this.login_fault = words.t('login_too_many', {seconds: answer.retry_s ?? 10});
    } else if (answer.status === 0) {
      this.login_fault = words.t('login_no_bridge');
    } else {
      this.login_fault = words.t('login_failed', {text: answer.text});
    }
    this.schedule(true);
  }

  async logOut(): Promise<void> {
    const answer = await api.logout();
    if (!answer.ok && answer.status !== 401) return;
    this.live.stop();
    this.me = null;
    this.sections = {};
    this.receipt = null;
    this.fetching = '';
    this.login = 'needed';
    this.schedule(true);
  }

  async ask(request: CommandRequest): Promise<void> {
    const asked: Asked = {request, request_id: null, fault: '', opened_ms: performance.now(), asked_ms: performance.now()};
    this.asked = asked;
    this.schedule(true);
    const answer = await api.command(request);
    if (answer.ok) {
      asked.request_id = answer.value.request_id;
    } else {
      const known = ['bad_request', 'not_logged_in', 'forbidden', 'too_many', 'cannot_send', 'network'].includes(answer.error);
      const line = known ? this.words.of('error_', answer.error) : answer.error;
      asked.fault = answer.text && answer.error === 'bad_request' ? `${line} (${answer.text})` : line || answer.text;
      if (answer.status === 401) this.login = 'needed';
    }
    asked.asked_ms = performance.now();
    this.schedule(true);
  }

  // What is told at the foot of the page; gone some seconds after the last word.
  notice(): {asked: Asked; command: Command | null} | null {
    const {asked} = this;
    if (!asked) return null;
    const command = this.sections.commands?.find((one) => one.request_id === asked.request_id) ?? null;
    const isOpen = !asked.fault && (!command || command.state === 'sent' || command.state === 'accepted');
    const now = performance.now();
    if (isOpen && now - asked.opened_ms < OPEN_NOTICE_MS) asked.asked_ms = now;
    return now - asked.asked_ms < NOTICE_MS ? {asked, command} : null;
  }

  private async enter(): Promise<void> {
    const answer = await api.me();
    if (answer.ok) {
      this.me = answer.value;
      this.login = 'in';
      this.live.start();
    } else if (answer.status === 401) {
      this.login = 'needed';
    } else {
      setTimeout(() => void this.enter(), 1000);
    }
    this.schedule(true);
  }

  private take(snapshot: Snapshot): void {
    Object.assign(this.sections, snapshot.sections);
    this.receipt = {at_utc_ms: snapshot.at_utc_ms, at_steady_ms: snapshot.at_steady_ms, ...this.clocks()};
    const steer = SteerPoint(this.sections.guidance ?? null);
    if (snapshot.sections.guidance && steer) this.track.add(steer);
    if (snapshot.number === 1) this.fetching = '';
    const wanted = steer?.name ?? this.sections.machine?.steer_by ?? '';
    const question = `${wanted}/${this.settings.behind_m}`;
    if (wanted && this.fetching !== question) {
      this.fetching = question;
      void this.fetchTrack(wanted, question);
    }
    this.newPage();
    this.schedule();
  }

  private async fetchTrack(point: string, question: string): Promise<void> {
    const answer = await api.advance(point, this.settings.behind_m);
    if (this.fetching !== question) return;
    this.has_history = answer.ok;
    if (answer.ok) this.track.load(answer.value);
    else setTimeout(() => { if (this.fetching === question) this.fetching = ''; }, 5000);
    this.schedule();
  }

  get isOldPage(): boolean {
    const theirs = this.sections.bridge?.page_build ?? '';
    return theirs !== '' && this.page_build !== 'development' && theirs !== this.page_build;
  }

  // Loads the bridge's page by itself, once for each build, and never under somebody's hands.
  private newPage(): void {
    const theirs = this.sections.bridge?.page_build ?? '';
    if (!this.isOldPage || this.dialog || this.route === 'station') return;
    try {
      if (sessionStorage.getItem(RELOAD_KEY) === theirs) return;
      sessionStorage.setItem(RELOAD_KEY, theirs);
    } catch {
      return;
    }
    location.reload();
  }

  private tick(): void {
    this.live.watch();
    this.sound.tick(this.wantedSound());
    if (performance.now() - this.rendered_ms > TICK_MS - 50) this.schedule();
  }

  private readRoute(): void {
    const wanted = location.hash.replace(/^#\/?/, '');
    this.route = ROUTES.find((route) => route === wanted) ?? 'drive';
    this.dialog = null;
    this.schedule(true);
  }
}

function OpenSocket(): Socket {
  const url = new URL('/api/live', location.href);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  const web = new WebSocket(url, 'tbm.console.v1');
  const socket: Socket = {
    onopen: null,
    onmessage: null,
    onclose: null,
    close: () => {
      web.onopen = web.onmessage = web.onclose = web.onerror = null;
      web.close();
    },
  };
  web.onopen = () => socket.onopen?.();
  web.onmessage = (event: MessageEvent<unknown>) => socket.onmessage?.(String(event.data));
  web.onclose = (event) => socket.onclose?.(event.code);
  return socket;
}
