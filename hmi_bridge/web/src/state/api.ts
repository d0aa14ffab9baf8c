// The bridge's REST part. Nothing here throws: what went wrong is a value.
import type {CommandRequest, History, Me, ReportRequest} from './types';

export type Outcome<T> = {ok: true; value: T} | {ok: false; status: number; error: string; text: string; retry_s: number | null};

async function Ask<T>(path: string, init: RequestInit = {}): Promise<Outcome<T>> {
  try {
    const answer = await fetch(path, {credentials: 'same-origin', cache: 'no-store', signal: AbortSignal.timeout(8000), ...init});
    if (answer.ok) return {ok: true, value: (answer.status === 204 ? null : await answer.json()) as T};
    const said = (await answer.json().catch(() => null)) as {error?: string; text?: string} | null;
    const retry = Number(answer.headers.get('Retry-After'));
    return {ok: false, status: answer.status, error: said?.error ?? '', text: said?.text ?? `HTTP ${answer.status}`, retry_s: retry > 0 ? retry : null};
  } catch {
    return {ok: false, status: 0, error: 'network', text: '', retry_s: null};
  }
}

const Post = <T>(path: string, body: unknown) =>
  Ask<T>(path, {method: 'POST', headers: {'Content-Type': 'application/json'}, body: JSON.stringify(body)});

export const api = {
  me: () => Ask<Me>('/api/me'),
  login: (name: string, password: string) => Post<Me>('/api/login', {name, password}),
  logout: () => Post<null>('/api/logout', {}),
  command: (request: CommandRequest) => Post<{request_id: string}>('/api/commands', request),
  report: (request: ReportRequest) => Post<{report_id: string}>('/api/reports', request),
  // The whole text, or null.
  text: async (path: string): Promise<string | null> => {
    try {
      const answer = await fetch(path, {credentials: 'same-origin', cache: 'no-store', signal: AbortSignal.timeout(30_000)});
      return answer.ok ? await answer.text() : null;
    } catch {
      return null;
    }
  },
  advance: (point: string, length_m: number) =>
    Ask<History>(`/api/advance?point=${encodeURIComponent(point)}&length_m=${length_m}`),
};
