// A table as `tbm export` writes it (RFC 4180): the header and the rows, cells unquoted.
export interface Table {
  header: string[];
  rows: string[][];
}

export function ParseCsv(text: string): Table {
  const lines: string[][] = [];
  let cells: string[] = [];
  let cell = '';
  let isQuoted = false;
  const endCell = () => {
    cells.push(cell);
    cell = '';
  };
  const endLine = () => {
    endCell();
    if (cells.length > 1 || cells[0] !== '') lines.push(cells);
    cells = [];
  };
  for (let i = 0; i < text.length; ++i) {
    const c = text[i];
    if (isQuoted) {
      if (c === '"' && text[i + 1] === '"') {
        cell += '"';
        ++i;
      } else if (c === '"') {
        isQuoted = false;
      } else {
        cell += c;
      }
    } else if (c === '"') {
      isQuoted = true;
    } else if (c === ',') {
      endCell();
    } else if (c === '\n') {
      endLine();
    } else if (c !== '\r') {
      cell += c;
    }
  }
  if (cell !== '' || cells.length > 0) endLine();
  const [header = [], ...rows] = lines;
  return {header, rows};
}

// Rows that hold every word of the question, in whatever cell and case.
export function Matching(table: Table, question: string): string[][] {
  const words = question.toLowerCase().split(/\s+/).filter((word) => word !== '');
  if (words.length === 0) return table.rows;
  return table.rows.filter((row) => {
    const line = row.join('\u0000').toLowerCase();
    return words.every((word) => line.includes(word));
  });
}

// Nanoseconds since 1970 as a time a person reads; anything else as it is.
export function CellText(column: string, cell: string): string {
  if (!column.endsWith('_utc_ns') || !/^\d{16,19}$/.test(cell)) return cell;
  return new Date(Number(BigInt(cell) / 1_000_000n)).toISOString().replace('T', ' ').slice(0, 23);
}
