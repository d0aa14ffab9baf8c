// Whether a value may be shown as one of now. Everything that the page draws passes here.
import type {Timing, Validity} from './types';

export type Quality = 'ok' | 'degraded' | 'coasting' | 'stale' | 'missing';

// The bridge's two clocks, taken from one answer, and the reader's two at its receipt.
export interface Receipt {
  at_utc_ms: number;
  at_steady_ms: number;
  performance_ms: number;
  date_ms: number;
}

export interface ReaderClocks {
  performance_ms: number;
  date_ms: number;
}

// A computer that slept stops the one clock, one that is set moves the other: the larger counts.
export function ElapsedSince(receipt: Receipt, now: ReaderClocks): number {
  return Math.max(0, now.performance_ms - receipt.performance_ms, now.date_ms - receipt.date_ms);
}

// The bridge's wall clock now. The reader's own wall clock has no part in it but its progress.
export function BridgeNow(receipt: Receipt, now: ReaderClocks): number {
  return receipt.at_utc_ms + ElapsedSince(receipt, now);
}

// The worse of the value's own stamp (either way: one of the future is as bad) and of its arrival.
export function AgeOf(timing: Timing, receipt: Receipt, now: ReaderClocks): number {
  const byStamp = Math.abs(receipt.at_utc_ms - timing.stamp_utc_ms);
  const byArrival = Math.max(0, receipt.at_steady_ms - timing.heard_steady_ms);
  return Math.max(byStamp, byArrival) + ElapsedSince(receipt, now);
}

const COASTING = new Set(['station_coasting', 'camera_coasting']);

export interface Facts {
  timing: Timing | null;
  validity: Validity;
  reason: string;
}

export interface Judgement {
  quality: Quality;
  reason: string;  // a code; empty: nothing odd
  age_ms: number | null;
  since_utc_ms: number | null;  // from when on it is stale, or its sender silent
  is_silent: boolean;  // older than is allowed, whatever else is the matter
}

// Of a part that somebody sent, before its single numbers are looked at.
export function Judge(facts: Facts | null, receipt: Receipt | null, now: ReaderClocks): Judgement {
  if (!facts || !receipt || !facts.timing) {
    return {quality: 'missing', reason: facts?.reason || 'never_heard', age_ms: null, since_utc_ms: null, is_silent: false};
  }
  const {timing} = facts;
  const age_ms = AgeOf(timing, receipt, now);
  const is_silent = !(age_ms <= timing.stale_after_ms);
  const since_utc_ms = is_silent ? BridgeNow(receipt, now) - age_ms : null;
  if (facts.validity === 'invalid') {
    return {quality: 'missing', reason: facts.reason || 'no_value', age_ms, since_utc_ms, is_silent};
  }
  // Which of two senders is right nobody knows: a number of either would be a guess.
  if (timing.contested) return {quality: 'missing', reason: 'contested', age_ms, since_utc_ms, is_silent};
  if (is_silent) return {quality: 'stale', reason: facts.reason, age_ms, since_utc_ms, is_silent};
  if (COASTING.has(facts.reason)) return {quality: 'coasting', reason: facts.reason, age_ms, since_utc_ms, is_silent};
  if (facts.validity === 'degraded') return {quality: 'degraded', reason: facts.reason, age_ms, since_utc_ms, is_silent};
  return {quality: 'ok', reason: facts.reason, age_ms, since_utc_ms, is_silent};
}

// Of one number of that part: one that is not known is missing, however fresh the part.
export function JudgeNumber(part: Judgement, value: number | null | undefined): Judgement {
  if (typeof value === 'number' && Number.isFinite(value)) return part;
  return {...part, quality: 'missing', reason: part.reason || 'no_value'};
}

const ORDER: Quality[] = ['ok', 'degraded', 'coasting', 'stale', 'missing'];

export function Worse(a: Quality, b: Quality): Quality {
  return ORDER.indexOf(a) >= ORDER.indexOf(b) ? a : b;
}
