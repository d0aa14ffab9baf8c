// The states that the page is looked at in.
import {alarm} from './fake_bridge.mjs';

const eachPoint = (s, change) => s.guidance.points.forEach(change);

export const SCENES = {
  ok: () => undefined,
  degraded: (bridge) => bridge.set((s) => {
    Object.assign(s.guidance, {validity: 'degraded', reason: 'camera_degraded'});
    eachPoint(s, (p) => { if (p.shield === 'front') Object.assign(p, {validity: 'degraded', reason: 'camera_degraded'}); });
    Object.assign(s.shields.front, {validity: 'degraded', reason: 'camera_degraded'});
    Object.assign(s.camera.pose, {status: 'degraded', reason: 'few_leds', leds_used: 4});
    s.camera.frame.spots.splice(1, 2);
  }),
  coasting: (bridge) => bridge.set((s) => {
    Object.assign(s.guidance, {validity: 'degraded', reason: 'station_coasting'});
    eachPoint(s, (p) => Object.assign(p, {validity: 'degraded', reason: 'station_coasting', right_sigma_mm: 6.2, up_sigma_mm: 5.1}));
    for (const name of ['front', 'rear']) Object.assign(s.shields[name], {validity: 'degraded', reason: 'station_coasting', age_s: 140});
    Object.assign(s.guidance.sources[0], {freshness: 'coasting', age_s: 140, reason: 'no_target'});
    s.alarms = {list: [alarm('station_late', 'medium', {cause: 'the total station has not fixed the rear shield in time', response: "is the sight to the prisms free? look at the station's alarms", raised_at_utc_ms: bridge.utc() - 80000})], first_out: 'guidance/station_late'};
  }),
  stale: (bridge) => bridge.set((s) => {
    bridge.held.add('guidance').add('shields').add('camera').add('guidance_device');
    for (const t of [s.guidance.timing, s.shields.front.timing, s.shields.rear.timing, s.camera.frame.timing]) {
      t.stamp_utc_ms -= 12000;
      t.heard_steady_ms -= 12000;
    }
    bridge.held.add('guidance');
    const device = s.devices.find((one) => one.id === 'guidance');
    device.timing.stamp_utc_ms -= 12000;
    device.timing.heard_steady_ms -= 12000;
    s.alarms = {list: [alarm('guidance_silent', 'high', {source: 'hmi_bridge', origin: 'console', cause: 'The guidance says nothing: there is no deviation.', response: 'Stop steering by this screen. See whether the program guidance runs and its computer is on.', raised_at_utc_ms: bridge.utc() - 11000}),
      alarm('camera_late', 'medium', {phase: 'acknowledged', acknowledged_by: 'keller', cause: 'the camera box gives no pose of the front shield', response: 'clean window and LEDs; look at camera and LEDs on the camera page', raised_at_utc_ms: bridge.utc() - 60000, silent_since_utc_ms: bridge.utc() - 11000})], first_out: 'guidance/camera_late'};
  }),
  missing: (bridge) => bridge.set((s) => {
    Object.assign(s.guidance, {validity: 'invalid', reason: 'camera_stale', lead_right_mm_per_m: null, lead_up_mm_per_m: null, lead_right_sigma_mm_per_m: null, lead_up_sigma_mm_per_m: null,
      articulation_right_deg: null, articulation_up_deg: null, articulation_roll_deg: null, articulation_right_sigma_deg: null, articulation_up_sigma_deg: null, articulation_roll_sigma_deg: null, stroke_mm: null, stroke_sigma_mm: null, ahead: []});
    eachPoint(s, (p) => { if (p.shield === 'front') for (const key of Object.keys(p)) if (!['name', 'shield'].includes(key)) p[key] = key === 'validity' ? 'invalid' : key === 'reason' ? 'camera_stale' : null; });
    for (const key of Object.keys(s.shields.front)) if (!['timing', 'validity', 'reason'].includes(key)) s.shields.front[key] = null;
    Object.assign(s.shields.front, {validity: 'invalid', reason: 'camera_stale'});
    Object.assign(s.guidance.sources[1], {freshness: 'missing', age_s: null, reason: 'frame_dark'});
    s.camera.pose = null;
    s.camera.frame = null;
    Object.assign(s.devices[0], {state: 'silent', since_utc_ms: bridge.utc() - 125000, detail: 'No frame for 125 s: check the cable.'});
    s.alarms = {list: [alarm('position_lost', 'high', {cause: 'there is no valid position of the front shield', response: 'do not steer by it; bring back the source that is named, or stop', raised_at_utc_ms: bridge.utc() - 5000}),
      alarm('camera_late', 'medium', {cause: 'the camera box gives no pose of the front shield', response: 'clean window and LEDs; look at camera and LEDs on the camera page', raised_at_utc_ms: bridge.utc() - 120000})], first_out: 'guidance/camera_late'};
  }),
  beyond: (bridge) => bridge.set((s) => {
    Object.assign(s.guidance.points[0], {right_mm: 61.3, up_mm: -34.8});
    Object.assign(s.guidance.points[1], {right_mm: 55.2, up_mm: -30.1});
    s.alarms = {list: [alarm('deviation_high', 'high', {value: 70.5, raise_above: 50, clear_below: 45, unit: 'mm', cause: 'the machine is further from the design axis than allowed', response: 'steer back in small steps; tell the shift engineer', raised_at_utc_ms: bridge.utc() - 9000})], first_out: 'guidance/deviation_high'};
  }),
  alarms: (bridge) => bridge.set((s) => {
    const utc = bridge.utc();
    s.alarms = {list: [
      alarm('station_moved', 'high', {source: 'total_station', cause: "The total station's bracket has moved or turned: 6.2 mm to the left.", response: 'Do not steer by what came after the last good check. Look at bracket and lining; when it stands firm, ask for set_up.', raised_at_utc_ms: utc - 62000}),
      alarm('set_up_not_good', 'high', {cause: "the total station's place is not known, or may have changed", response: 'have the references checked; set the station up again if they disagree', raised_at_utc_ms: utc - 60000, phase: 'acknowledged', acknowledged_by: 'keller'}),
      alarm('predicted_deviation_high', 'medium', {value: 83.4, raise_above: 80, clear_below: 70, unit: 'mm', cause: 'in 10 m the machine will be too far from the design axis', response: "change the jacks' pressures now: the deviation still grows for some metres", raised_at_utc_ms: utc - 40000, times_raised: 3}),
      alarm('journal_not_written', 'medium', {source: 'guidance_process', origin: 'event', cause: 'the journal is not written: no space left', response: '', raised_at_utc_ms: utc - 30000, silent_since_utc_ms: utc - 10000}),
      alarm('tilt_late', 'low', {phase: 'returned_unacknowledged', cause: 'an inclinometer is silent', response: 'check its cable and supply', raised_at_utc_ms: utc - 300000}),
      alarm('low_power', 'low', {source: 'total_station', phase: 'acknowledged', acknowledged_by: 'li', cause: "The total station's battery is nearly empty.", response: 'Change the battery or connect external power.', raised_at_utc_ms: utc - 600000, shelved_until_utc_ms: utc + 1500000, shelved_by: 'li', shelved_because: 'spare battery comes with the next train'})],
      first_out: 'guidance/tilt_late'};
  }),
  trolley_open: (bridge) => bridge.set((s) => {
    Object.assign(s.trolley.state, {status: 'open', position_sigma_mm: [3.2, 8.4, 1.9], target_age_s: 14.2, came_too_late: 3});
    s.trolley.settlement.highest_alert = 2;
  }),
  trolley_none: (bridge) => bridge.set((s) => {
    Object.assign(s.trolley.state, {status: 'none', reason: 'waiting_for_rest', position_world_m: null, position_sigma_mm: null, speed_m_per_s: null, distance_m: null, target_age_s: null, tilt_age_s: null, rest_age_s: null});
    s.trolley.settlement = null;
  }),
  move: (bridge) => bridge.set((s) => {
    Object.assign(s.station.in_use, {state: 'suspect', reason: 'station_moving'});
    s.station.proposed = {...bridge.setUp(5, 'good', ''), closure_mm: [0.8, -0.6, 0.3], closure_worst_mm: 1.6, closure_tolerance_mm: 3, closure_points: 5};
  }),
};
