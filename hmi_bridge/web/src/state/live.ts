// The connection to the bridge: made again for ever, and believed only while it speaks.
import {BackoffMs} from './backoff';
import type {Snapshot} from './types';

export interface Socket {
  close(): void;
  onopen: (() => void) | null;
  onmessage: ((text: string) => void) | null;
  onclose: ((code: number) => void) | null;
}

export interface LiveHost {
  open(): Socket;
  // 401 when nobody is logged in: a socket does not tell why it was refused.
  isLoggedIn(): Promise<boolean>;
  now(): number;
  after(ms: number, what: () => void): () => void;
}

export interface LiveEvents {
  snapshot(snapshot: Snapshot): void;
  changed(): void;
  loggedOut(): void;
}

// The bridge speaks at least once a second.
export const SILENCE_MS = 1500;
const HANDSHAKE_MS = 5000;
const SESSION_ENDED = 4401;

export class Live {
  state: 'connecting' | 'live' | 'down' | 'stopped' = 'connecting';
  attempts = 0;
  private socket: Socket | null = null;
  private cancel: (() => void) | null = null;
  private heard = 0;

  constructor(private readonly host: LiveHost, private readonly events: LiveEvents) {}

  start(): void {
    this.stop();
    this.attempts = 0;
    this.connect();
  }

  stop(): void {
    this.cancel?.();
    this.cancel = null;
    this.drop();
    this.state = 'stopped';
  }

  // To be called a few times a second: silence makes no event of its own, and timers sleep with the
  // computer.
  watch(): void {
    const longest = this.state === 'live' ? SILENCE_MS : HANDSHAKE_MS;
    if (this.socket && this.host.now() - this.heard > longest) this.lost(1006);
  }

  private connect(): void {
    const socket = this.host.open();
    this.socket = socket;
    this.heard = this.host.now();
    if (this.state !== 'down') this.state = 'connecting';
    socket.onopen = () => {
      this.heard = this.host.now();
    };
    socket.onmessage = (text) => {
      if (this.socket !== socket) return;
      const snapshot = Parse(text);
      if (!snapshot) {
        this.lost(1002);
        return;
      }
      this.heard = this.host.now();
      this.attempts = 0;
      const was = this.state;
      this.state = 'live';
      this.events.snapshot(snapshot);
      if (was !== 'live') this.events.changed();
    };
    socket.onclose = (code) => {
      if (this.socket === socket) this.lost(code);
    };
  }

  private drop(): void {
    const socket = this.socket;
    this.socket = null;
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
  }

  private lost(code: number): void {
    const wasLive = this.state === 'live';
    this.drop();
    this.state = 'down';
    this.events.changed();
    const wait = BackoffMs(this.attempts);
    this.attempts += 1;
    this.cancel?.();
    const again = () => {
      this.cancel = this.host.after(wait, () => {
        if (this.state === 'down') this.connect();
      });
    };
    if (code !== SESSION_ENDED && wasLive) {
      again();
      return;
    }
    void this.host.isLoggedIn().then((is) => {
      if (this.state !== 'down' || this.socket) return;
      if (is) again();
      else this.events.loggedOut();
    }, () => {
      if (this.state === 'down' && !this.socket) again();
    });
  }
}

function Parse(text: string): Snapshot | null {
  try {
    const snapshot = JSON.parse(text) as Snapshot;
    const isOne = Number.isFinite(snapshot?.at_utc_ms) && Number.isFinite(snapshot?.at_steady_ms) &&
      typeof snapshot.sections === 'object' && snapshot.sections !== null;
    return isOne ? snapshot : null;
  } catch {
    return null;
  }
}
