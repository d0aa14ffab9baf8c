// What the camera sees, in its own pixels: for whoever cleans lens and LEDs.
import {html, nothing, svg, type TemplateResult} from 'lit';

import type {App} from '../state/app';
import {DASHES, Fixed} from '../state/format';
import {Judge, type Judgement} from '../state/freshness';
import {QualityChip, QualityText} from './reading_view';

// Residuals of a tenth of a pixel are to be seen on a panel from half a metre.
export function ResidualFactor(width_px: number): number {
  return width_px >= 1500 ? 1000 : width_px >= 500 ? 500 : 200;
}

export function FrameJudgement(app: App): Judgement {
  const frame = app.sections.camera?.frame ?? null;
  const pose = app.sections.camera?.pose ?? null;
  const validity = pose?.status === 'none' ? 'degraded' : pose?.status === 'degraded' ? 'degraded' : 'valid';
  return Judge(frame && {timing: frame.timing, validity: frame.reason ? 'degraded' : validity, reason: frame.reason || pose?.reason || ''}, app.receipt, app.clocks());
}

export function CameraPicture(app: App, isLarge: boolean): TemplateResult {
  const {words, sections} = app;
  const machine = sections.machine ?? null;
  const frame = sections.camera?.frame ?? null;
  const pose = sections.camera?.pose ?? null;
  const judged = FrameJudgement(app);
  const width = machine?.image_width_px || 1280;
  const height = machine?.image_height_px || 1024;
  const factor = ResidualFactor(width);
  const isShown = frame && judged.quality !== 'missing';
  const unit = width / (isLarge ? 760 : 190);  // image pixels to one of the screen, about
  const leds = machine?.leds ?? [];
  const seen = new Set(frame?.spots.map((spot) => spot.led).filter((led) => led !== null));
  const lost = leds.filter((led) => !seen.has(led));
  return html`<figure class="panel camera ${isLarge ? 'large' : ''}" data-quality=${judged.quality}>
    <figcaption><b>${words.t(isLarge ? 'camera_view' : 'camera')}</b>
      ${frame ? html`<span>${words.t('camera_leds', {used: seen.size, all: leds.length})}</span><span class="factor">${words.t('camera_magnified', {factor})}</span>` : nothing}
    </figcaption>
    <div class="picture">
      <svg viewBox="0 0 ${width} ${height}" role="img" aria-label=${words.t('camera_view')} stroke-width=${unit.toFixed(2)}>
        <rect class="image" width=${width} height=${height}/>
        ${isShown ? frame.spots.map((spot) => svg`
          <g class="spot" font-size=${(12 * unit).toFixed(1)} data-led=${spot.led ?? ''} data-excluded=${spot.led !== null && spot.led === pose?.excluded_led}
              transform="translate(${spot.u_px.toFixed(1)} ${spot.v_px.toFixed(1)})">
            ${spot.led === null
              ? svg`<path class="other" d="M${-5 * unit} ${-5 * unit}L${5 * unit} ${5 * unit}M${5 * unit} ${-5 * unit}L${-5 * unit} ${5 * unit}"/>`
              : svg`<circle class="led" r=${(5 * unit).toFixed(1)}/>`}
            ${spot.residual_u_px === null || spot.residual_v_px === null ? nothing
              : svg`<path class="residual" d="M0 0L${(spot.residual_u_px * factor).toFixed(1)} ${(spot.residual_v_px * factor).toFixed(1)}"/>`}
            ${spot.led === null ? nothing : svg`<text x=${(9 * unit).toFixed(1)} y=${(-5 * unit).toFixed(1)}>${spot.led}${
              spot.led === pose?.excluded_led ? ` ${words.t('camera_excluded')}` : ''}</text>`}
          </g>`) : nothing}
      </svg>
      ${judged.quality === 'stale' || judged.quality === 'missing'
        ? html`<div class="veil" data-quality=${judged.quality}><b>${words.t(`quality_${judged.quality}`)}</b><span>${frame ? nothing : words.t('camera_missing')}</span></div>` : nothing}
    </div>
    <p class="legend">${judged.quality === 'ok' ? nothing : html`<b class="matter">${QualityText(judged, words)}</b>`}
      ${isShown && lost.length ? html`<span class="lost">${words.t('camera_not_seen')}: ${lost.join(', ')}</span>` : nothing}</p>
  </figure>`;
}

export function CameraPage(app: App): TemplateResult {
  const {words, sections} = app;
  const frame = sections.camera?.frame ?? null;
  const pose = sections.camera?.pose ?? null;
  const judgedPose = Judge(pose && {timing: pose.timing, validity: pose.status === 'ok' ? 'valid' : pose.status === 'degraded' ? 'degraded' : 'invalid', reason: pose.reason}, app.receipt, app.clocks());
  return html`<main class="page page-camera" id="content">
    ${CameraPicture(app, true)}
    <section class="panel side">
      <h2>${words.t('camera_pose')} ${QualityChip(judgedPose, words)}</h2>
      <p>${judgedPose.quality === 'ok' ? nothing : QualityText(judgedPose, words)}</p>
      ${pose ? html`<p>${words.t('rms')}: ${Fixed(pose.rms_px, 3)} px</p>` : nothing}
      ${frame ? html`
        <p>${words.t('camera_frames', {received: frame.received, lost: frame.lost, damaged: frame.damaged, skipped: frame.skipped})}</p>
        <p>${words.t('camera_light', {exposure: Fixed(frame.exposure_us, 0), background: Fixed(frame.background_dn, 1), noise: Fixed(frame.noise_dn, 2)})}</p>
        <p>${words.t('camera_rejected', {rejected: frame.rejected_spots, dropped: frame.dropped_spots})}</p>
        <table><thead><tr><th scope="col">${words.t('led')}</th><th scope="col" class="num">${words.t('brightness')}</th><th scope="col" class="num">${words.t('residual')} px</th></tr></thead>
          <tbody>${(sections.machine?.leds ?? []).map((led) => {
            const spot = frame.spots.find((one) => one.led === led) ?? null;
            const residual = spot?.residual_u_px != null && spot.residual_v_px != null ? Math.hypot(spot.residual_u_px, spot.residual_v_px) : null;
            return html`<tr data-lost=${spot === null}><th scope="row">${led}</th>
              ${spot ? html`<td class="num">${Fixed(spot.peak_dn, 0)} DN</td><td class="num">${residual === null ? DASHES : Fixed(residual, 3)}</td>`
                : html`<td colspan="2" class="matter">⊘ ${words.t('camera_not_seen')}</td>`}</tr>`;
          })}
          <tr><th scope="row">${words.t('camera_other_spots')}</th><td class="num" colspan="2">${frame.spots.filter((spot) => spot.led === null).length}</td></tr></tbody></table>` : html`<p>${words.t('camera_missing')}</p>`}
    </section>
  </main>`;
}
