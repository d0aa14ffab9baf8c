import {describe, expect, it} from 'vitest';

import {CellText, Matching, ParseCsv} from '../src/state/csv';
import {REPORT_TEXTS} from '../src/text/reports';

describe('a table of tbm export', () => {
  it('has a header and rows', () => {
    expect(ParseCsv('a,b\n1,2\n3,4\n')).toEqual({header: ['a', 'b'], rows: [['1', '2'], ['3', '4']]});
  });
  it('keeps commas, quotes and line ends inside quotes', () => {
    expect(ParseCsv('a,b\n"x, ""y""\nz",2\n').rows).toEqual([['x, "y"\nz', '2']]);
  });
  it('reads CRLF and a last line without end', () => {
    expect(ParseCsv('a,b\r\n1,2').rows).toEqual([['1', '2']]);
  });
  it('keeps empty cells and drops empty lines', () => {
    expect(ParseCsv('a,b\n,\n\n1,\n').rows).toEqual([['', ''], ['1', '']]);
  });
  it('of nothing is empty', () => {
    expect(ParseCsv('')).toEqual({header: [], rows: []});
  });
  it('cut anywhere is still a table', () => {
    const whole = 'a,b\n"x, ""y""",2\n3,"4"\n';
    for (let i = 0; i <= whole.length; ++i) {
      for (const row of ParseCsv(whole.slice(0, i)).rows) expect(row.length).toBeLessThanOrEqual(2);
    }
  });
});

describe('search', () => {
  const table = ParseCsv('who,what\nann,shelve tilt_late\nbob,acknowledge roll_high\n');
  it('wants every word, in any cell and case', () => {
    expect(Matching(table, 'ANN tilt')).toEqual([['ann', 'shelve tilt_late']]);
    expect(Matching(table, 'ann roll')).toEqual([]);
    expect(Matching(table, '  ').length).toBe(2);
  });
  it('does not find across the border of two cells', () => {
    expect(Matching(table, 'annshelve')).toEqual([]);
  });
});

describe('cells', () => {
  it('show nanoseconds as a time', () => {
    expect(CellText('at_utc_ns', '1700000000123456789')).toBe('2023-11-14 22:13:20.123');
  });
  it('leave everything else as it is', () => {
    expect(CellText('at_utc_ns', '-1')).toBe('-1');
    expect(CellText('number', '1700000000123456789')).toBe('1700000000123456789');
  });
});

describe('words of the reports', () => {
  it('are there in every language, with the same places to fill in', () => {
    for (const [key, text] of Object.entries(REPORT_TEXTS.en)) {
      for (const table of [REPORT_TEXTS.de, REPORT_TEXTS.zh] as Record<string, string>[]) {
        expect(table[key], key).toBeTruthy();
        expect((table[key] ?? '').match(/\{\w+\}/g)?.sort() ?? [], key).toEqual(text.match(/\{\w+\}/g)?.sort() ?? []);
      }
    }
  });
});
