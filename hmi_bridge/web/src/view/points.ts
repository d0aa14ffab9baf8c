// The numbers that one steers by, and those of every other point.
import {html, nothing, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {Fixed} from '../state/format';
import type {Readings} from '../state/readings';
import {ARROWS} from '../state/signs';
import {MARKS, NumberView, QualityChip, QualityText, LastText} from './reading_view';
import {ShapeIcon} from './target';

function Big(app: App, readings: Readings, name: string, axis: 'right' | 'up'): TemplateResult {
  const {words, settings} = app;
  const id = `point.${name}.${axis}`;
  const reading = readings.get(id);
  const quality = reading?.judgement.quality ?? 'missing';
  const isLive = reading && (quality === 'ok' || quality === 'degraded' || quality === 'coasting');
  const direction = isLive ? reading.direction ?? 'none' : null;
  const under = direction
    ? html`<span class="arrow" aria-hidden="true">${ARROWS[direction]}</span> ${words.t(`${settings.signs}_${direction}`)}`
    : reading && quality === 'stale'
      ? LastText(reading, words)
      : reading && reading.judgement.reason !== readings.get(`point.${name}.right`)?.judgement.reason
        ? words.reason(reading.judgement.reason) : words.t('quality_missing');
  return html`<div class="big" data-quality=${quality}>
    <span class="label">${direction && quality !== 'ok' ? html`<span class="mark" aria-hidden="true">${MARKS[quality]}</span> ` : nothing}${words.t(`column_${axis}_${settings.signs}`)} <span class="unit">mm</span></span>
    ${reading ? NumberView(app, readings, id, {size: 'huge'}) : html`<span class="number huge" data-quality="missing"><span class="dashes">– –</span></span>`}
    <span class="under">${under}</span>
  </div>`;
}

export function Points(app: App, readings: Readings): TemplateResult {
  const {words, sections, settings} = app;
  const guidance = sections.guidance ?? null;
  const steer = guidance?.steer_by || sections.machine?.steer_by || '';
  const names = guidance?.points.length ? guidance.points.map((p) => p.name) : (sections.machine?.points ?? []).map((p) => p.name);
  const right = readings.get(`point.${steer}.right`);
  const quality = right?.judgement.quality ?? 'missing';
  const limit_mm = sections.machine?.deviation_limit_mm ?? null;
  const up = readings.get(`point.${steer}.up`);
  const off_mm = right?.value == null ? null : Math.hypot(right.value, up?.value ?? 0);
  const isBeyond = off_mm !== null && limit_mm !== null && off_mm > limit_mm && quality !== 'stale' && quality !== 'missing';
  return html`<section class="panel numbers" aria-label=${words.t('points')}>
    <header class="numbers-head" data-quality=${quality}>
      <b>${ShapeIcon(0, true)} ${steer ? words.point(steer) : '–'}</b>
      <span class="state" data-quality=${quality}>${right ? (quality === 'ok' ? nothing : QualityText(right.judgement, words)) : words.reason('never_heard')}</span>
      ${isBeyond ? html`<span class="beyond">▲ ${Fixed(off_mm, 0)} mm &gt; ${words.t('limit')} ${Fixed(limit_mm, 0)}</span>` : nothing}
    </header>
    <div class="bigs" data-beyond=${isBeyond}>${Big(app, readings, steer, 'right')}${Big(app, readings, steer, 'up')}</div>
    <div class="rows" tabindex="-1"><table class="points">
      <thead><tr>
        <th scope="col">${words.t('point')}</th>
        <th scope="col" class="num">${words.t(`column_right_${settings.signs}`)}</th>
        <th scope="col" class="num">${words.t(`column_up_${settings.signs}`)}</th>
        <th scope="col">${words.t('quality')}</th>
      </tr></thead>
      <tbody>${names.map((name, index) => {
        if (name === steer) return nothing;  // it stands above, large
        const one = readings.get(`point.${name}.right`);
        return html`<tr data-point=${name} data-quality=${one?.judgement.quality ?? 'missing'}>
          <th scope="row">${ShapeIcon(index, false)}<span>${words.point(name)}</span></th>
          <td class="num">${NumberView(app, readings, `point.${name}.right`, {arrow: true})}</td>
          <td class="num">${NumberView(app, readings, `point.${name}.up`, {arrow: true})}</td>
          <td>${one ? QualityChip(one.judgement, words) : nothing}</td>
        </tr>`;
      })}</tbody>
    </table></div>
    <p class="convention">${words.t(`convention_${settings.signs}`)}</p>
  </section>`;
}
