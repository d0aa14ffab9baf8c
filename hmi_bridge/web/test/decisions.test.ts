// What the page decides without a browser.
import {describe, expect, it} from 'vitest';

import {InOrder, KeyOf, PATTERNS, RequestFor, ShelfChoices, SoundFor, ViewOf} from '../src/state/alarms';
import {BackoffMs} from '../src/state/backoff';
import {DesignAt} from '../src/state/design_ahead';
import {Chainage, ClockTime, DASHES, Fixed, Signed, Span} from '../src/state/format';
import {AgeOf, BridgeNow, ElapsedSince, Judge, JudgeNumber, Worse, type Receipt} from '../src/state/freshness';
import {Live, SILENCE_MS, type Socket} from '../src/state/live';
import {EllipseOf, ReadingsOf} from '../src/state/readings';
import {RingBuffer} from '../src/state/ring_buffer';
import {ScaleFor, Ticks} from '../src/state/scale';
import {Defaults, LoadSettings, ThemeAt} from '../src/state/settings';
import {AngleFromDeg, AngleFromMmPerM, DirectionOf, Shown} from '../src/state/signs';
import {ClosureOf, MoveArgument, StepOf} from '../src/state/station_move';
import {Track} from '../src/state/track';
import type {Alarm, Guidance, Point, Snapshot, Station, Timing} from '../src/state/types';
import {Words} from '../src/text/index';

const receipt: Receipt = {at_utc_ms: 1_000_000, at_steady_ms: 50_000, performance_ms: 100, date_ms: 9_000_000};
const at = (ms: number) => ({performance_ms: 100 + ms, date_ms: 9_000_000 + ms});
const timing = (more: Partial<Timing> = {}): Timing => ({stamp_utc_ms: 999_900, heard_steady_ms: 49_950, stale_after_ms: 1000, ...more});
const part = (more: Partial<{timing: Timing | null; validity: 'valid' | 'degraded' | 'invalid'; reason: string}> = {}) =>
  ({timing: timing(), validity: 'valid' as const, reason: '', ...more});

describe('freshness', () => {
  it('takes the worse of stamp and arrival, and adds what passed since the answer', () => {
    expect(AgeOf(timing(), receipt, at(0))).toBe(100);
    expect(AgeOf(timing({heard_steady_ms: 49_000}), receipt, at(0))).toBe(1000);
    expect(AgeOf(timing(), receipt, at(700))).toBe(800);
  });
  it('finds a stamp of the future as bad as one of the past', () => {
    expect(AgeOf(timing({stamp_utc_ms: 1_005_000}), receipt, at(0))).toBe(5000);
  });
  it('does not ask what the reader takes for the time', () => {
    const off = {...receipt, date_ms: receipt.date_ms + 3_600_000};
    expect(AgeOf(timing(), off, {performance_ms: 100, date_ms: off.date_ms})).toBe(100);
    expect(BridgeNow(off, {performance_ms: 600, date_ms: off.date_ms + 500})).toBe(1_000_500);
  });
  it('counts the sleep of the computer, which stops the one clock', () => {
    expect(ElapsedSince(receipt, {performance_ms: 110, date_ms: 9_060_000})).toBe(60_000);
    expect(ElapsedSince(receipt, {performance_ms: 5100, date_ms: 8_000_000})).toBe(5000);
    expect(ElapsedSince(receipt, {performance_ms: 0, date_ms: 0})).toBe(0);
  });
  it('is stale from just beyond two periods on, and says since when', () => {
    expect(Judge(part(), receipt, at(900)).quality).toBe('ok');
    const judged = Judge(part(), receipt, at(901));
    expect(judged.quality).toBe('stale');
    expect(judged.since_utc_ms).toBe(999_900);
  });
  it('never shows NaN as fresh', () => {
    expect(Judge(part({timing: timing({stamp_utc_ms: NaN})}), receipt, at(0)).quality).toBe('stale');
  });
  it('tells the five qualities apart', () => {
    expect(Judge(null, receipt, at(0))).toMatchObject({quality: 'missing', reason: 'never_heard'});
    expect(Judge(part({timing: null}), receipt, at(0)).quality).toBe('missing');
    expect(Judge(part(), null, at(0)).quality).toBe('missing');
    expect(Judge(part({validity: 'invalid', reason: 'no_fix'}), receipt, at(0))).toMatchObject({quality: 'missing', reason: 'no_fix'});
    expect(Judge(part({validity: 'degraded', reason: 'few_prisms'}), receipt, at(0)).quality).toBe('degraded');
    for (const reason of ['station_coasting', 'camera_coasting']) {
      expect(Judge(part({validity: 'degraded', reason}), receipt, at(0)).quality).toBe('coasting');
    }
  });
  it('trusts neither of two senders', () => {
    expect(Judge(part({timing: timing({contested: true})}), receipt, at(0))).toMatchObject({quality: 'missing', reason: 'contested'});
  });
  it('lets staleness win over degraded, and an invalid sender that fell silent say so', () => {
    expect(Judge(part({validity: 'degraded', reason: 'few_leds'}), receipt, at(5000)).quality).toBe('stale');
    expect(Judge(part({validity: 'invalid', reason: 'no_fix'}), receipt, at(5000))).toMatchObject({quality: 'missing', is_silent: true, since_utc_ms: 999_900});
  });
  it('has no number where none was given, and zero is one', () => {
    const good = Judge(part(), receipt, at(0));
    expect(JudgeNumber(good, null)).toMatchObject({quality: 'missing', reason: 'no_value'});
    expect(JudgeNumber(good, NaN).quality).toBe('missing');
    expect(JudgeNumber(good, 0).quality).toBe('ok');
    expect(Worse('ok', 'coasting')).toBe('coasting');
    expect(Worse('stale', 'degraded')).toBe('stale');
  });
});

describe('format', () => {
  it('writes chainages as on the wall', () => {
    expect(Chainage(2345.678)).toBe('2+345.678');
    expect(Chainage(12.3456)).toBe('0+012.346');
    expect(Chainage(999.9999)).toBe('1+000.000');
    expect(Chainage(-1.5)).toBe('−0+001.500');
    expect(Chainage(-0.0001)).toBe('0+000.000');
    expect(Chainage(12040, 0)).toBe('12+040');
    expect(Chainage(null)).toBe(DASHES);
  });
  it('has a true minus, no minus zero, and dashes for nothing', () => {
    expect(Signed(-13.24, 1)).toBe('−13.2');
    expect(Signed(12.5, 1)).toBe('+12.5');
    expect(Signed(-0.04, 1)).toBe('0.0');
    expect(Signed(0.04, 1)).toBe('0.0');
    expect(Fixed(null, 1)).toBe(DASHES);
    expect(Fixed(NaN, 1)).toBe(DASHES);
  });
  it('writes spans as exact as one can use', () => {
    expect(Span(99)).toBe('0.0 s');
    expect(Span(2560)).toBe('2.5 s');
    expect(Span(12_900)).toBe('12 s');
    expect(Span(300_000)).toBe('5 min');
    expect(Span(11_100_000)).toBe('3 h 05 min');
    expect(Span(-5)).toBe('0.0 s');
    expect(Span(null)).toBe(DASHES);
  });
  it('writes times, and dashes without one', () => {
    expect(ClockTime(Date.UTC(2026, 0, 1, 10, 2, 5))).toBe('10:02:05');
    expect(ClockTime(null)).toBe(DASHES);
  });
});

describe('signs', () => {
  it('shows where the machine is, or what to steer: the opposite', () => {
    expect(Shown(-13.2, {signs: 'machine'})).toBe(-13.2);
    expect(Shown(-13.2, {signs: 'steer'})).toBe(13.2);
    expect(Object.is(Shown(0, {signs: 'steer'}), 0)).toBe(true);
    expect(Shown(null, {signs: 'steer'})).toBeNull();
  });
  it('points with its arrow where its number says', () => {
    expect(DirectionOf(12.4, 'right')).toBe('right');
    expect(DirectionOf(-12.4, 'right')).toBe('left');
    expect(DirectionOf(-3, 'up')).toBe('down');
    expect(DirectionOf(0.04, 'up')).toBe('none');
    expect(DirectionOf(null, 'up')).toBe('none');
  });
  it('turns angles into the site\'s unit', () => {
    expect(AngleFromDeg(1, {angles: 'mm_per_m'})).toBeCloseTo(17.4533, 4);
    expect(AngleFromDeg(1, {angles: 'deg'})).toBe(1);
    expect(AngleFromMmPerM(17.4533, {angles: 'deg'})).toBeCloseTo(1, 5);
    expect(AngleFromMmPerM(2, {angles: 'mm_per_m'})).toBe(2);
    expect(AngleFromDeg(undefined, {angles: 'deg'})).toBeNull();
  });
});

describe('scales', () => {
  it('grow at once and shrink only when it is worth it', () => {
    expect(ScaleFor(17, null)).toBe(20);
    expect(ScaleFor(19, null)).toBe(50);
    expect(ScaleFor(60, 50)).toBe(100);
    expect(ScaleFor(40, 100)).toBe(100);
    expect(ScaleFor(30, 100)).toBe(50);
    expect(ScaleFor(9999, null)).toBe(500);
  });
  it('have lines at round numbers', () => {
    expect(Ticks(2012, 2071, 4)).toEqual([2020, 2040, 2060]);
  });
});

describe('ring buffer and track', () => {
  it('keeps the newest in memory that does not grow', () => {
    const ring = new RingBuffer<number>(3);
    for (let i = 0; i < 10; i += 1) ring.push(i);
    expect(ring.toArray()).toEqual([7, 8, 9]);
    expect(ring.newest()).toBe(9);
    expect(ring.at(3)).toBeUndefined();
    ring.clear();
    expect(ring.size).toBe(0);
    expect(() => new RingBuffer(0)).toThrow();
  });
  it('adds a row when the machine has moved, and gaps stay gaps', () => {
    const track = new Track();
    const columns = {at_utc_ms: [0, 0, 0], chainage_m: [1, 1.05, null], right_mm: [3, null, 1], up_mm: [1, null, 1], right_sigma_mm: [], up_sigma_mm: [], validity: []};
    track.load({point: 'front', columns});
    const point = (chainage_m: number | null, name = 'front') => ({name, chainage_m, right_mm: 4, up_mm: 2}) as Point;
    track.add(point(1.06));
    track.add(point(null));
    track.add(point(1.2, 'rear'));
    expect(track.since(0, 10).length).toBe(2);
    track.add(point(1.11));
    expect(track.since(0, 10).map((row) => row.right_mm)).toEqual([3, null, 4]);
    expect(track.since(1.1, 10).length).toBe(1);
    for (let i = 0; i < 10_000; i += 1) track.add(point(2 + i));
    expect(track.since(0, 1e9).length).toBe(2100);
    expect(track.since(0, 50).length).toBe(50);
  });
});

const alarm = (code: string, more: Partial<Alarm> = {}): Alarm => ({
  source: 'guidance', code, origin: 'process', phase: 'unacknowledged', urgency: 'medium', since_utc_ms: 0, raised_at_utc_ms: 0, times_raised: 1, value: null, raise_above: null,
  clear_below: null, unit: '', cause: '', response: '', acknowledged_by: '', shelved_until_utc_ms: null, shelved_by: '', shelved_because: '', silent_since_utc_ms: null, ...more});

describe('alarms', () => {
  const list = [
    alarm('a', {phase: 'acknowledged', urgency: 'high', raised_at_utc_ms: 1}),
    alarm('b', {urgency: 'low', raised_at_utc_ms: 2}),
    alarm('c', {urgency: 'high', raised_at_utc_ms: 9}),
    alarm('d', {urgency: 'high', raised_at_utc_ms: 5}),
    alarm('e', {urgency: 'high', phase: 'returned_unacknowledged', raised_at_utc_ms: 1}),
    alarm('f', {urgency: 'high', shelved_until_utc_ms: 2000, raised_at_utc_ms: 1}),
    alarm('g', {phase: 'normal', shelved_until_utc_ms: 500}),
  ];
  it('stand unacknowledged before acknowledged, urgent first, of these the first raised', () => {
    expect(InOrder(list.slice(0, 5)).map((one) => one.code)).toEqual(['d', 'c', 'e', 'b', 'a']);
  });
  it('are shelved until their time by the bridge\'s clock, and then come back', () => {
    const view = ViewOf(list, 1000);
    expect(view.shelved.map((one) => one.code)).toEqual(['f']);
    expect(view.worst?.code).toBe('d');
    expect(view.counts).toEqual({high: 4, medium: 0, low: 1});
    expect(view.unacknowledged).toBe(4);
    expect(ViewOf(list, 2000).active.some((one) => one.code === 'f')).toBe(true);
    expect(ViewOf([], 0).worst).toBeNull();
  });
  it('stay as they are when their process falls silent', () => {
    expect(ViewOf([alarm('x', {silent_since_utc_ms: 1})], 1000).active.length).toBe(1);
  });
  it('are addressed to who watches, all others to the bridge', () => {
    expect(RequestFor(alarm('roll_high'), 'acknowledge', '')).toEqual({addressee: 'guidance', verb: 'acknowledge', argument: 'roll_high', because: ''});
    expect(RequestFor(alarm('roll_high'), 'shelve', 'known', 30).argument).toBe('roll_high 30');
    expect(RequestFor(alarm('no_network', {source: 'hmi_bridge', origin: 'console'}), 'unshelve', '')).toMatchObject({addressee: 'hmi_bridge', argument: 'hmi_bridge/no_network'});
    expect(RequestFor(alarm('journal_not_written', {source: 'guidance_process', origin: 'event'}), 'shelve', 'x', 15)).toMatchObject({addressee: 'hmi_bridge', argument: 'guidance_process/journal_not_written 15'});
  });
  it('are shelved for half an hour at most when high', () => {
    expect(ShelfChoices('high')).toEqual([15, 30]);
    expect(ShelfChoices('low')).toEqual([15, 30, 60, 480]);
  });
  it('sound while nobody has acknowledged or shelved them', () => {
    const state = {sound: true, muted_until_ms: 0, bridge_now_ms: 1000, now_ms: 10, is_down: false};
    expect(SoundFor(list, state)).toBe('high');
    expect(SoundFor([list[0]!, list[4]!, list[5]!], state)).toBeNull();
    expect(SoundFor([list[1]!], state)).toBe('low');
    expect(SoundFor(list, {...state, sound: false})).toBeNull();
    expect(SoundFor(list, {...state, muted_until_ms: 11})).toBeNull();
    expect(SoundFor(list, {...state, muted_until_ms: 10})).toBe('high');
    expect(SoundFor([], {...state, is_down: true})).toBe('high');
    expect(new Set(Object.values(PATTERNS).map((p) => `${p.starts_s.length}/${p.frequency_hz}`)).size).toBe(3);
    expect(KeyOf(alarm('x'))).toBe('guidance/x');
  });
});

describe('design ahead', () => {
  const row = (chainage_m: number, curvature_per_km: number, gradient_percent: number | null = -1) => ({chainage_m, bearing_deg: 0, curvature_per_km, gradient_percent, height_m: 0});
  const axis = [row(0, 0), row(5, 0), row(10, 0), row(15, 1), row(20, 2), row(25, 2), row(30, 2, 0.5), row(35, -2, 0.5)];
  it('says what is here and what comes', () => {
    expect(DesignAt(axis, 2, 1000)).toMatchObject({now: {kind: 'straight'}, next: {kind: 'transition', side: 'right', in_m: 8}, gradient_percent: -1, next_gradient: {percent: 0.5, in_m: 28}, ends_in_m: null});
    expect(DesignAt(axis, 22, 1000)?.now).toMatchObject({kind: 'curve', side: 'right', radius_m: 500});
  });
  it('says that it ends, and nothing without a place', () => {
    expect(DesignAt(axis, 22, 35)?.ends_in_m).toBe(13);
    expect(DesignAt(axis, null, 35)).toBeNull();
    expect(DesignAt([], 3, 35)).toBeNull();
  });
});

describe('connection', () => {
  const setUp = (isLoggedIn: () => Promise<boolean> = async () => true) => {
    const sockets: (Socket & {isClosed: boolean})[] = [];
    const waits: {ms: number; what: () => void}[] = [];
    const seen: Snapshot[] = [];
    let now = 0;
    let loggedOut = 0;
    const live = new Live({
      open: () => {
        const socket = {onopen: null, onmessage: null, onclose: null, isClosed: false, close() { this.isClosed = true; }};
        sockets.push(socket);
        return socket;
      },
      isLoggedIn, now: () => now,
      after: (ms, what) => {
        waits.push({ms, what});
        return () => undefined;
      },
    }, {snapshot: (one) => seen.push(one), changed: () => undefined, loggedOut: () => { loggedOut += 1; }});
    const say = (text = '{"number":1,"at_utc_ms":1,"at_steady_ms":1,"sections":{}}') => sockets.at(-1)?.onmessage?.(text);
    return {live, sockets, waits, seen, say, pass: (ms: number) => { now += ms; live.watch(); }, out: () => loggedOut};
  };
  it('believes the bridge only while it speaks', () => {
    const {live, sockets, waits, say, pass} = setUp();
    live.start();
    say();
    expect(live.state).toBe('live');
    pass(SILENCE_MS);
    expect(live.state).toBe('live');
    pass(1);
    expect(live.state).toBe('down');
    expect(SILENCE_MS).toBeLessThan(1900);
    expect(sockets[0]?.isClosed).toBe(true);
    expect(waits[0]?.ms).toBe(300);
    waits[0]?.what();
    expect(live.state).toBe('down');
    say();
    expect(live.state).toBe('live');
    expect(live.attempts).toBe(0);
  });
  it('tries for ever, at most two seconds apart', () => {
    expect(BackoffMs(0)).toBe(300);
    expect(BackoffMs(1)).toBe(480);
    expect(BackoffMs(9)).toBe(2000);
    expect(BackoffMs(1e9)).toBe(2000);
  });
  it('asks for the log-in when the session has ended, and not when the bridge is away', async () => {
    const ended = setUp(async () => false);
    ended.live.start();
    ended.say();
    ended.sockets[0]?.onclose?.(4401);
    await Promise.resolve();
    await Promise.resolve();
    expect(ended.out()).toBe(1);
    const away = setUp(async () => { throw new Error('no bridge'); });
    away.live.start();
    away.sockets[0]?.onclose?.(1006);
    for (let i = 0; i < 5; i += 1) await Promise.resolve();
    expect(away.out()).toBe(0);
    expect(away.waits.length).toBe(1);
  });
  it('drops a connection that talks nonsense, and hears nothing of an old one', () => {
    const {live, sockets, seen, say} = setUp();
    live.start();
    say('{"at_utc_ms":"x"}');
    expect(live.state).toBe('down');
    live.start();
    const old = sockets.at(-1)?.onmessage;
    live.start();
    old?.('{"number":1,"at_utc_ms":1,"at_steady_ms":1,"sections":{}}');
    expect(seen.length).toBe(0);
    live.stop();
    expect(live.state).toBe('stopped');
  });
});

describe('settings', () => {
  const store = (text: string | null) => ({getItem: () => text, setItem: () => undefined});
  it('come out usable whatever was kept', () => {
    expect(LoadSettings(store('{"language":"xx","signs":"steer","behind_m":7}'), 'de-AT')).toMatchObject({language: 'de', signs: 'steer', behind_m: 50});
    expect(LoadSettings(store('not json'), 'fr')).toEqual(Defaults('fr'));
    expect(LoadSettings(store('null'), 'zh-CN').language).toBe('zh');
    expect(LoadSettings({getItem: () => { throw new Error('denied'); }, setItem: () => undefined}, 'en').sound).toBe(true);
  });
  it('know the night', () => {
    expect(ThemeAt('auto', 19)).toBe('night');
    expect(ThemeAt('auto', 7)).toBe('day');
    expect(ThemeAt('day', 23)).toBe('day');
  });
});

describe('readings', () => {
  it('stand in the site\'s signs, each with its judgement', () => {
    const point = {name: 'front', shield: 'front', validity: 'valid', reason: '', right_mm: -13.2, up_mm: null, right_sigma_mm: 2, up_sigma_mm: 1, correlation: 0, chainage_m: 5, official_chainage_m: 10005,
      trend_right_mm_per_m: 0.5, trend_length_m: 4} as unknown as Point;
    const guidance = {timing: timing(), validity: 'valid', reason: '', steer_by: 'front', points: [point], sources: [], lead_right_mm_per_m: 1} as unknown as Guidance;
    const settings = {...Defaults('en'), signs: 'steer' as const};
    const readings = ReadingsOf({sections: {guidance}, receipt, now: at(0), settings, words: new Words('en')});
    expect(readings.get('point.front.right')).toMatchObject({text: '+13.2', direction: 'right', trend: '−0.5 mm/m over 4.0 m'});
    expect(readings.get('point.front.up')?.judgement).toMatchObject({quality: 'missing', reason: 'no_value'});
    expect(readings.get('chainage')?.text).toBe('10+005.000');
    expect(readings.get('lead')?.text).toBe('−1.0');
    expect(readings.get('roll_front')?.judgement.reason).toBe('never_heard');
    expect(ReadingsOf({sections: {}, receipt: null, now: at(0), settings, words: new Words('en')}).get('stroke')?.judgement.quality).toBe('missing');
  });
  it('have an ellipse of 95 %', () => {
    const ellipse = EllipseOf({right_sigma_mm: 3, up_sigma_mm: 1, correlation: 0});
    expect(ellipse?.major_mm).toBeCloseTo(7.343, 2);
    expect(ellipse?.turned_deg).toBeCloseTo(0);
    expect(EllipseOf({right_sigma_mm: 2, up_sigma_mm: 2, correlation: 0.5})?.turned_deg).toBeCloseTo(45);
    expect(EllipseOf({right_sigma_mm: null, up_sigma_mm: 2, correlation: 0})).toBeNull();
  });
});

describe('station move', () => {
  it('writes what the process reads', () => {
    expect(MoveArgument('1017.8, 5017.7, 101.6', ' R11 ')).toEqual({argument: '1017.8,5017.7,101.6,R11'});
    expect(MoveArgument('1 2 3', '12.5')).toEqual({argument: '1,2,3,12.5'});
    expect(MoveArgument('1, 2', 'R11')).toEqual({fault: 'place'});
    expect(MoveArgument('a, b, c', 'R11')).toEqual({fault: 'place'});
    expect(MoveArgument('1,2,3', '')).toEqual({fault: 'aim'});
    expect(MoveArgument('1,2,3', 'R1,R2')).toEqual({fault: 'aim'});
  });
  it('knows its step and its closure', () => {
    const station = (more: object) => ({in_use: null, proposed: null, previous: null, observations: [], ...more}) as Station;
    expect(StepOf(null)).toBe('idle');
    expect(StepOf(station({in_use: {reason: 'station_moving'}}))).toBe('away');
    expect(StepOf(station({proposed: {state: 'good'}}))).toBe('proposed');
    expect(StepOf(station({proposed: {state: 'none'}}))).toBe('idle');
    const proposed = (worst: number | null) => ({closure_worst_mm: worst, closure_tolerance_mm: 3}) as Station['proposed'];
    expect(ClosureOf(proposed(3))).toBe('good');
    expect(ClosureOf(proposed(3.1))).toBe('bad');
    expect(ClosureOf(proposed(null))).toBe('missing');
    expect(ClosureOf(null)).toBe('missing');
  });
});
