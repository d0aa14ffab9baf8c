// Every code that can come has its line in each language, and no line is left over.
import {readFileSync} from 'node:fs';

import {describe, expect, it} from 'vitest';

import {Fill, TEXTS, Words} from '../src/text/index';

const Read = (path: string) => readFileSync(new URL(`../../../${path}`, import.meta.url), 'utf8');
const Codes = (text: string) => [...text.matchAll(/`([a-z][a-z0-9_]+)`/g)].map((match) => match[1] as string);

function Section(text: string, title: string): string {
  const begin = text.indexOf(`\n## ${title}`);
  if (begin < 0) throw new Error(`no section ${title}`);
  const end = text.indexOf('\n## ', begin + 4);
  return text.slice(begin, end < 0 ? undefined : end);
}

const FirstCells = (text: string) => text.split('\n').filter((line) => line.startsWith('| `')).flatMap((line) => Codes(line.split('|')[1] ?? ''));

const idl = Read('idl/README.md');
const PAGE_REASONS = ['never_heard', 'no_value', 'contested', 'trolley_gap', 'trolley_open'];

function Reasons(): Set<string> {
  const section = Section(idl, 'Reasons');
  const codes = new Set(FirstCells(section));
  // Fields and messages, named in the same sentences.
  const others = new Set(['reason', 'reason_code', 'relative_pose', 'frame_features', 'inclination', 'shield_pose', 'guidance', 'station', 'camera', 'station_set_up', 'station_observation', 'trolley_state', 'calibration_status', 'useful_sigma_mm', 'imu_silent_after_ms']);
  for (const paragraph of section.split('\n\n')) {
    if (!paragraph.startsWith('`reason` of') || paragraph.includes('| ')) continue;
    for (const code of Codes(paragraph)) if (!others.has(code)) codes.add(code);
  }
  for (const row of Read('devices/total_station/station_words.cc').matchAll(/\{"([a-z_]+)",/g)) codes.add(row[1] as string);
  for (const code of PAGE_REASONS) codes.add(code);
  return codes;
}

function Alarms(): Set<string> {
  const codes = new Set([...FirstCells(Section(idl, 'Alarms of the DDS side')), ...FirstCells(Section(idl, 'Alarms of the guidance')), 'journal_not_written', 'other_machine']);
  for (const line of Read('devices/README.md').split('\n')) {
    if (/^\| `(station|reference|prism|wrong|low)_/.test(line)) for (const code of Codes(line.split('|')[1] ?? '')) codes.add(code);
  }
  const rules = Read('hmi_bridge/core/own_alarms.cc');
  for (const rule of rules.slice(rules.indexOf('kRules'), rules.indexOf('KeyOf')).matchAll(/\{ConsoleAlarm::\w+,\s*"([a-z_]+)"/g)) codes.add(rule[1] as string);
  return codes;
}

describe.each(Object.entries(TEXTS))('language %s', (code, table) => {
  it('has a line for each reason, and none too many', () => {
    expect(Reasons().size).toBeGreaterThan(90);
    expect(Object.keys(table.reasons).sort()).toEqual([...Reasons()].sort());
  });
  it('has a line for each alarm, and none too many', () => {
    expect(Alarms().size).toBeGreaterThan(30);
    expect(Object.keys(table.alarms).sort()).toEqual([...Alarms()].sort());
  });
  it('has the keys and places of the master table', () => {
    const places = (text: string) => [...text.matchAll(/\{\w+\}/g)].map(String).sort();
    expect(Object.keys(table.ui)).toEqual(Object.keys(TEXTS.en.ui));
    for (const [key, text] of Object.entries(TEXTS.en.ui)) expect(places(table.ui[key as keyof typeof table.ui]), key).toEqual(places(text));
  });
  it('says something everywhere, and in its own words', () => {
    const lines = [...Object.values(table.ui), ...Object.values(table.reasons), ...Object.values(table.alarms).flat()];
    expect(lines.every((line) => line.trim() !== '')).toBe(true);
    if (code === 'zh') for (const line of [...Object.values(table.reasons), ...Object.values(table.alarms).flat()]) expect(line).toMatch(/\p{Script=Han}/u);
  });
  it('knows every verb and every state of the contract', () => {
    const words = new Words(code as 'en');
    for (const verb of Codes(Section(idl, 'Commands').split('\n').filter((line) => line.startsWith('|')).map((line) => line.split('|')[2] ?? '').join(' '))) expect(words.of('verb_', verb), verb).not.toBe('');
    const contract = Read('hmi_bridge/openapi.yaml');
    const states = /state: \{enum: \[(sent[^\]]+)\]/.exec(contract)?.[1]?.split(', ') ?? [];
    expect(states.length).toBe(6);
    for (const state of states) expect(Object.hasOwn(table.ui, `state_${state}`), state).toBe(true);
    const phases = /phase: \{enum: \[([^\]]+)\]/.exec(contract)?.[1]?.split(', ') ?? [];
    for (const phase of phases) expect(Object.hasOwn(table.ui, `phase_${phase}`), phase).toBe(true);
    const verbs = ['acknowledge', 'shelve', 'unshelve', 'check_references', 'set_up', 'propose_move', 'take_over_move', 'give_up_move', 'undo_move', 'pause', 'resume'];
    for (const verb of verbs) expect(Object.hasOwn(table.ui, `verb_${verb}`), verb).toBe(true);
  });
});

describe('words', () => {
  it('fill places, and leave what is not theirs', () => {
    expect(Fill('a {x} {y}', {x: 1})).toBe('a 1 {y}');
  });
  it('keep what the process says to who reads English, and its particulars behind a translation', () => {
    const moved = {source: 'total_station', code: 'station_moved', cause: "The total station's bracket has moved or turned: 6.2 mm to the left.", response: 'x'};
    expect(new Words('en').cause(moved)).toContain('6.2 mm to the left.');
    expect(new Words('de').cause(moved)).toBe('Die Konsole des Tachymeters hat sich bewegt oder gedreht (6.2 mm to the left)');
    expect(new Words('zh').cause({source: 'x', code: 'unknown_code', cause: 'as it came'})).toBe('as it came');
    expect(new Words('zh').cause({source: 'x', code: 'unknown_code', cause: ''})).toBe('unknown code');
    expect(new Words('zh').reason('constructor')).toBe('constructor');
    expect(new Words('de').response({code: 'roll_high', response: 'x'})).toContain('Bohrkopf');
  });
});
