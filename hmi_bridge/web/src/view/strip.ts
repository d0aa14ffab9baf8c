// Plan and profile along the design axis: behind from memory, ahead as predicted.
import {html, nothing, svg, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {Chainage, Fixed} from '../state/format';
import {Judge} from '../state/freshness';
import {DesignAt, type Bend} from '../state/design_ahead';
import {SteerPoint, type Readings} from '../state/readings';
import {ScaleFor, Ticks} from '../state/scale';
import type {Words} from '../text/index';
import type {Sizes} from './sizes';
import {PointShape} from './target';

const AHEAD_M = 20;
const scales: Record<string, number | null> = {right: null, up: null};

export function BendText(bend: Bend, words: Words): string {
  if (bend.kind === 'straight') return words.t('design_straight');
  const side = bend.side ?? 'right';
  return bend.kind === 'curve'
    ? words.t(`design_curve_${side}`, {radius: Fixed(bend.radius_m, 0)})
    : words.t(`design_transition_${side}`);
}

export function DesignText(app: App, axis: 'right' | 'up'): string {
  const {words, sections} = app;
  const machine = sections.machine;
  const chainage_m = SteerPoint(sections.guidance ?? null)?.chainage_m ?? null;
  const design = machine ? DesignAt(machine.axis, chainage_m, machine.axis_end_m) : null;
  if (!design) return words.t('design_unknown');
  const parts: string[] = [];
  if (axis === 'right') parts.push(BendText(design.now, words));
  if (axis === 'right' && design.next) parts.push(words.t('design_in', {what: BendText(design.next, words), m: Fixed(design.next.in_m, 0)}));
  if (axis === 'up' && design.gradient_percent !== null) parts.push(words.t('design_gradient', {percent: Fixed(design.gradient_percent, 2)}));
  if (axis === 'up' && design.next_gradient) parts.push(words.t('design_gradient_in', {percent: Fixed(design.next_gradient.percent, 2), m: Fixed(design.next_gradient.in_m, 0)}));
  if (axis === 'right' && design.ends_in_m !== null) parts.push(words.t('design_ends', {m: Fixed(design.ends_in_m, 0)}));
  return parts.join(' · ');
}

function Strip(app: App, readings: Readings, sizes: Sizes, axis: 'right' | 'up'): TemplateResult {
  const {words, sections, settings} = app;
  const guidance = sections.guidance ?? null;
  const machine = sections.machine ?? null;
  const name = axis === 'right' ? 'plan' : 'profile';
  const {width, height} = sizes.of(name);
  const steer = SteerPoint(guidance);
  const judged = Judge(guidance && {timing: guidance.timing, validity: guidance.validity, reason: guidance.reason}, app.receipt, app.clocks());
  const isLive = judged.quality !== 'stale' && judged.quality !== 'missing';
  const here_m = steer?.chainage_m ?? null;
  const official = settings.chainage === 'official' && steer?.official_chainage_m != null && here_m !== null ? steer.official_chainage_m - here_m : 0;
  let picture: TemplateResult | typeof nothing = nothing;
  if (here_m !== null && width > 60 && height > 40) {
    const from = here_m - settings.behind_m;
    const to = here_m + AHEAD_M;
    const rows = app.track.since(from, Math.max(2, Math.round(width / 2)));
    const ahead = isLive ? (guidance?.ahead ?? []).filter((row) => row[`${axis}_mm`] !== null && row.ahead_m <= AHEAD_M) : [];
    let reach = 0;
    for (const row of rows) reach = Math.max(reach, Math.abs(row[`${axis}_mm`] ?? 0));
    for (const point of guidance?.points ?? []) reach = Math.max(reach, Math.abs(point[`${axis}_mm`] ?? 0));
    for (const row of ahead) if (row.ahead_m <= 10) reach = Math.max(reach, Math.abs(row[`${axis}_mm`] ?? 0));
    const scale = ScaleFor(reach, scales[axis] ?? null);
    scales[axis] = scale;
    const left = 34;
    const bottom = 16;
    const top = 4;
    const w = width - left - 4;
    const h = height - bottom - top;
    const x = (m: number) => left + ((m - from) / (to - from)) * w;
    // On the plan right is down, as on any plan whose chainage runs to the right.
    const up = axis === 'right' ? -1 : 1;
    const y = (mm: number) => top + h / 2 - up * (Math.max(-scale * 1.02, Math.min(scale * 1.02, mm)) / scale) * (h / 2 - 2);
    const at = (m: number, mm: number) => `${x(m).toFixed(1)},${y(mm).toFixed(1)}`;
    const lines: string[] = [];
    let run: string[] = [];
    for (const row of rows) {
      const value = row[`${axis}_mm`];
      if (value === null) {
        if (run.length > 1) lines.push(run.join(' '));
        run = [];
      } else run.push(at(row.chainage_m, value));
    }
    const now = steer?.[`${axis}_mm`] ?? null;
    if (now !== null) run.push(at(here_m, now));
    if (run.length > 1) lines.push(run.join(' '));
    const path = now === null ? [] : [{ahead_m: 0, value: now, sigma: steer?.[`${axis}_sigma_mm`] ?? 0},
      ...ahead.map((row) => ({ahead_m: row.ahead_m, value: row[`${axis}_mm`] ?? 0, sigma: row[`${axis}_sigma_mm`] ?? 0}))];
    const band = path.length > 1
      ? [...path.map((p) => at(here_m + p.ahead_m, p.value + 2 * p.sigma)), ...path.toReversed().map((p) => at(here_m + p.ahead_m, p.value - 2 * p.sigma))].join(' ') : '';
    const limit = machine?.deviation_limit_mm ?? null;
    const far = machine?.predicted_limit_mm ?? null;
    const edge = (mm: number) => mm <= scale;
    picture = svg`
      <g class="grid">
        ${[-scale, -scale / 2, 0, scale / 2, scale].map((mm) => svg`<path class=${mm === 0 ? 'axis-line' : ''} d="M${left} ${y(mm).toFixed(1)}H${width - 4}"/>`)}
        ${Ticks(from + official, to + official, Math.max(3, Math.round(w / 90))).map((m) => svg`<path d="M${x(m - official).toFixed(1)} ${top}V${top + h}"/>`)}
      </g>
      <g class="figures">
        ${[-scale, 0, scale].map((mm) => svg`<text x=${left - 5} y=${(y(mm) + (mm === 0 ? 4 : y(mm) < top + h / 2 ? 9 : 0)).toFixed(1)} text-anchor="end">${mm > 0 ? `+${mm}` : mm < 0 ? `−${-mm}` : 0}</text>`)}
        ${Ticks(from + official, to + official, Math.max(3, Math.round(w / 90))).filter((m) => x(m - official) > left + 24 && x(m - official) < width - 28)
          .map((m) => svg`<text x=${x(m - official).toFixed(1)} y=${height - 3} text-anchor="middle">${Chainage(m, 0)}</text>`)}
      </g>
      ${limit !== null && edge(limit) ? svg`<path class="limit" d="M${left} ${y(limit).toFixed(1)}H${x(here_m).toFixed(1)}M${left} ${y(-limit).toFixed(1)}H${x(here_m).toFixed(1)}"/>` : nothing}
      ${far !== null && edge(far) ? svg`<path class="limit" d="M${x(here_m).toFixed(1)} ${y(far).toFixed(1)}H${width - 4}M${x(here_m).toFixed(1)} ${y(-far).toFixed(1)}H${width - 4}"/>` : nothing}
      <path class="face" d="M${x(here_m).toFixed(1)} ${top}V${top + h}"/>
      ${band ? svg`<polygon class="band" points=${band}/>` : nothing}
      ${path.length > 1 ? svg`<polyline class="path" points=${path.map((p) => at(here_m + p.ahead_m, p.value)).join(' ')}/>` : nothing}
      ${lines.map((line) => svg`<polyline class="behind" points=${line}/>`)}
      ${(guidance?.points ?? []).map((point, index) => {
        const value = point[`${axis}_mm`];
        if (value === null || point.chainage_m === null || point.chainage_m < from) return nothing;
        const reading = readings.get(`point.${point.name}.${axis}`);
        return svg`<g class="spot" data-steered=${point.name === guidance?.steer_by} data-quality=${reading?.judgement.quality ?? 'missing'}
          transform="translate(${x(point.chainage_m).toFixed(1)} ${y(value).toFixed(1)}) scale(0.62)">${PointShape(index, point.name === guidance?.steer_by)}</g>`;
      })}`;
  }
  return html`<figure class="panel strip" data-strip=${name} data-quality=${here_m === null ? 'missing' : judged.quality}>
    <figcaption><b>${words.t(name)}</b> <span class="side">+ ${words.t(axis)} ${axis === 'right' ? '▼' : '▲'} mm</span>
      ${guidance && isLive && guidance.ahead.length === 0 ? html`<span class="none">${words.t('prediction_none')}</span>` : nothing}
      <span class="design" title=${words.t('design')}>${DesignText(app, axis)}</span>
    </figcaption>
    <div class="picture" ${sizes.watch(name)}>
      <svg width=${width} height=${height} viewBox="0 0 ${Math.max(width, 1)} ${Math.max(height, 1)}" role="img" aria-label=${words.t(axis === 'right' ? 'plan_strip' : 'profile_strip')}>${picture}</svg>
      ${isLive ? nothing : html`<div class="veil" data-quality=${judged.quality}><b>${words.t(`quality_${judged.quality}`)}</b><span>${judged.reason ? words.reason(judged.reason) : nothing}</span></div>`}
    </div>
  </figure>`;
}

export function Strips(app: App, readings: Readings, sizes: Sizes): TemplateResult {
  return html`${Strip(app, readings, sizes, 'right')}${Strip(app, readings, sizes, 'up')}`;
}
