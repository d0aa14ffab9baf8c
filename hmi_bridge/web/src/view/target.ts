// The cross target: where each point of the machine is, seen in the direction of the drive.
import {html, nothing, svg, type SVGTemplateResult, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {ClockTime} from '../state/format';
import {Judge, Worse, type Quality} from '../state/freshness';
import {EllipseOf, SteerPoint, type Readings} from '../state/readings';
import {ScaleFor, TickStep} from '../state/scale';

const TRAIL_M = 5;
const SIDE = 360;  // of the picture's own coordinates
const HALF = SIDE / 2 - 14;

// In the order of the machine file; the point that one steers by is always the cross in the circle.
const SHAPES = [
  svg`<path d="M0-7L7 6H-7z"/>`,
  svg`<path d="M-6-6H6V6H-6z"/>`,
  svg`<path d="M0-8L8 0L0 8L-8 0z"/>`,
  svg`<circle r="6.5"/>`,
  svg`<path d="M0 7L7-6H-7z"/>`,
  svg`<path d="M-7-3H7V3H-7z"/>`,
];
const STEERED = svg`<circle r="10"/><path d="M-15 0H15M0-15V15"/>`;

export function PointShape(index: number, isSteered: boolean): SVGTemplateResult {
  return isSteered ? STEERED : (SHAPES[index % SHAPES.length] as SVGTemplateResult);
}

export function ShapeIcon(index: number, isSteered: boolean): TemplateResult {
  return html`<svg class="shape" viewBox="-16 -16 32 32" aria-hidden="true" data-steered=${isSteered}>${PointShape(index, isSteered)}</svg>`;
}

interface Spot {
  name: string;
  index: number;
  x_mm: number;
  y_mm: number;
  isSteered: boolean;
  quality: Quality;
}

export function Target(app: App, readings: Readings): TemplateResult {
  const {words, sections} = app;
  const guidance = sections.guidance ?? null;
  const machine = sections.machine ?? null;
  const limit_mm = machine?.deviation_limit_mm ?? null;
  const spots: Spot[] = [];
  guidance?.points.forEach((point, index) => {
    const right = readings.get(`point.${point.name}.right`);
    const up = readings.get(`point.${point.name}.up`);
    if (!right || point.right_mm === null) return;
    // The picture is the machine as it lies, whatever signs the site gives its numbers.
    spots.push({
      name: point.name, index, x_mm: point.right_mm, y_mm: point.up_mm ?? 0,
      isSteered: point.name === guidance.steer_by, quality: Worse(right.judgement.quality, up?.value == null ? 'ok' : up.judgement.quality),
    });
  });
  const steered = spots.find((spot) => spot.isSteered) ?? null;
  const reach = Math.max(...spots.map((spot) => Math.hypot(spot.x_mm, spot.y_mm)), 0);
  const wanted = reach === 0 && limit_mm ? limit_mm * 0.8 : reach;
  const scale_mm = ScaleFor(wanted, app.target_scale_mm);
  app.target_scale_mm = scale_mm;
  const px = HALF / scale_mm;
  const x = (mm: number) => (mm * px).toFixed(1);
  const y = (mm: number) => (-mm * px).toFixed(1);
  const step = TickStep(scale_mm, 4);
  const rings: number[] = [];
  for (let mm = step; mm <= scale_mm + 1e-9; mm += step) rings.push(mm);
  const isStale = steered?.quality === 'stale';
  const part = Judge(guidance && {timing: guidance.timing, validity: guidance.validity, reason: guidance.reason}, app.receipt, app.clocks());
  const isBeyond = steered !== null && !isStale && limit_mm !== null && Math.hypot(steered.x_mm, steered.y_mm) > limit_mm;

  const point = SteerPoint(guidance);
  const ellipse = steered && !isStale ? EllipseOf(point) : null;
  const from_m = (point?.chainage_m ?? Infinity) - TRAIL_M;
  const trail = point?.chainage_m == null ? [] : app.track.since(from_m, 120)
    .map((row) => [row.right_mm, row.up_mm] as const)
    .filter((row): row is readonly [number, number] => row[0] !== null && row[1] !== null);
  if (steered && trail.length && !isStale) trail.push([steered.x_mm, steered.y_mm]);
  const inside = (mm: number) => Math.max(-scale_mm, Math.min(scale_mm, mm));
  // Labels go outward, and those too near to one already set go without: the table has them all.
  const labelled: Spot[] = [];
  for (const spot of [...spots].sort((a, b) => Number(b.isSteered) - Number(a.isSteered))) {
    const isFree = labelled.every((other) =>
      Math.abs(other.y_mm - spot.y_mm) * px > 15 || Math.abs(other.x_mm - spot.x_mm) * px > 84);
    if (isFree) labelled.push(spot);
  }
  return html`<figure class="panel target" data-quality=${steered ? steered.quality : 'missing'}>
    <figcaption><b>${words.t('target')}</b><span class="scale">${words.t('target_scale', {mm: scale_mm})}</span></figcaption>
    <svg viewBox="${-SIDE / 2} ${-SIDE / 2} ${SIDE} ${SIDE}" role="img" aria-label="${words.t('target')}, ${words.t('picture_convention')}">
      <g class="grid">
        ${rings.map((mm) => svg`<circle r=${x(mm)}/>`)}
        <path d="M${-HALF} 0H${HALF}M0 ${-HALF}V${HALF}"/>
      </g>
      <g class="figures">
        ${rings.map((mm) => svg`<text x=${x(mm)} y="12" text-anchor="middle">${mm}</text>`)}
        <text class="side" x=${-HALF} y="-6">${words.t('left')}</text>
        <text class="side" x=${HALF} y="-6" text-anchor="end">${words.t('right')}</text>
        <text class="side" x="6" y=${-HALF - 3}>${words.t('up')}</text>
        <text class="side" x="6" y=${HALF + 11}>${words.t('down')}</text>
      </g>
      ${limit_mm !== null && limit_mm <= scale_mm * 1.02 ? svg`<circle class="limit" data-beyond=${isBeyond} r=${x(limit_mm)}/>` : nothing}
      ${trail.length > 1 ? svg`<polyline class="trail" points=${trail.map(([a, b]) => `${x(inside(a))},${y(inside(b))}`).join(' ')}/>` : nothing}
      ${ellipse && steered ? svg`<ellipse class="ellipse" rx=${(ellipse.major_mm * px).toFixed(1)} ry=${(ellipse.minor_mm * px).toFixed(1)}
          transform="translate(${x(steered.x_mm)} ${y(steered.y_mm)}) rotate(${(-ellipse.turned_deg).toFixed(1)})"/>` : nothing}
      ${labelled.map((spot) => {
        const px_x = inside(spot.x_mm) * px;
        const side = px_x <= HALF - 90 ? 1 : -1;
        const isOut = Math.abs(spot.x_mm) > scale_mm || Math.abs(spot.y_mm) > scale_mm;
        return svg`<text class="name" data-steered=${spot.isSteered} x=${(px_x + side * (spot.isSteered ? 18 : 11)).toFixed(1)}
          y=${(-inside(spot.y_mm) * px + (spot.isSteered ? -7 : 4)).toFixed(1)} text-anchor=${side === 1 ? 'start' : 'end'}>${words.point(spot.name)}${isOut ? ` (${words.t('off_scale')})` : ''}</text>`;
      })}
      ${[...spots].sort((a, b) => Number(a.isSteered) - Number(b.isSteered)).map((spot) => svg`<g class="spot" data-point=${spot.name} data-quality=${spot.quality}
          data-steered=${spot.isSteered} transform="translate(${x(inside(spot.x_mm))} ${y(inside(spot.y_mm))})">${PointShape(spot.index, spot.isSteered)}</g>`)}
    </svg>
    ${part.quality === 'stale' || part.quality === 'missing'
      ? html`<div class="veil" data-quality=${part.quality}><b>${words.t(`quality_${part.quality}`)}</b>
          <span>${part.since_utc_ms === null ? nothing : words.t('since', {time: ClockTime(part.since_utc_ms)})}</span>
          <span>${part.quality === 'missing' || part.reason ? words.reason(part.reason) : nothing}</span></div>` : nothing}
    <p class="legend">
      <span>${words.t('picture_convention')}</span>
      ${limit_mm === null ? nothing : html`<span class="key limit-key">${words.t('target_limit', {mm: limit_mm})}</span>`}
      <span class="key ellipse-key">${words.t('target_ellipse')}</span>
      <span class="key trail-key">${trail.length > 1 ? words.t('trail', {m: TRAIL_M}) : words.t('no_trail')}</span>
    </p>
  </figure>`;
}
