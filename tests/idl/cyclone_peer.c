/* Another vendor's end of the wire: Cyclone DDS with types that its own compiler made from the same
 * IDL files.
 *
 *   idl_cyclone_peer write DOMAIN   one sample of each topic, every field a value of its own
 *   idl_cyclone_peer read DOMAIN    prints each sample it gets as lines "topic.field=value", then
 *                                   "topic.end"; ends when all five topics have come
 *
 * The values are those of tests/idl/samples.h, written out once more by hand. */
#include "cyclone/device_health.h"
#include "cyclone/event.h"
#include "cyclone/frame_features.h"
#include "cyclone/inclination.h"
#include "cyclone/relative_pose.h"
#include "dds/dds.h"
#include <inttypes.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { kFeatures, kInclination, kPose, kHealth, kEvent, kTopics };

static const char* const kNames[kTopics] = {"tbm/v1/frame_features",
                                            "tbm/v1/inclination",
                                            "tbm/v1/relative_pose",
                                            "tbm/v1/device_health",
                                            "tbm/v1/event"};

static const dds_topic_descriptor_t* Descriptor(int topic) {
  switch (topic) {
    case kFeatures:
      return &tbm_v1_FrameFeatures_desc;
    case kInclination:
      return &tbm_v1_Inclination_desc;
    case kPose:
      return &tbm_v1_RelativePose_desc;
    case kHealth:
      return &tbm_v1_DeviceHealth_desc;
    default:
      return &tbm_v1_Event_desc;
  }
}

/* The QoS classes of idl/README.md. */
static dds_qos_t* ClassQos(int topic) {
  dds_qos_t* qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(100));
  if (topic == kHealth || topic == kEvent) dds_qset_durability(qos, DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, topic == kEvent ? 8 : topic == kHealth ? 1 : 5);
  if (topic == kHealth) dds_qset_deadline(qos, DDS_MSECS(3000));
  if (topic < kHealth) dds_qset_deadline(qos, DDS_MSECS(500));
  return qos;
}

static void FillFeatures(tbm_v1_FrameFeatures* m, tbm_v1_Spot* spots) {
  strcpy(m->machine_id, "machine-7");
  m->sensed_at_utc_ns = 1700000000000000001;
  m->published_at_utc_ns = 1700000000000000002;
  m->frame_number = 3000000000003u;
  m->exposure_s = 0.004;
  strcpy(m->reason, "frame_saturated");
  m->background_dn = 5.5;
  m->noise_dn = 6.25;
  m->rejected_spots = 7;
  m->dropped_spots = 8;
  m->frames_received = 9000000000009u;
  m->frames_lost = 10;
  m->frames_damaged = 11;
  m->frames_skipped = 12;
  for (int i = 0; i < 3; ++i) {
    tbm_v1_Spot spot = {.u_px = 100.125 + 20 * i,
                        .v_px = 101.25 + 20 * i,
                        .sigma_px = 0.102 + i,
                        .peak_dn = 103.0 + 20 * i,
                        .background_dn = 104.0 + 20 * i,
                        .spread_px = 105.5 + 20 * i,
                        .elongation = 106.5 + 20 * i,
                        .clipped_pixels = 107 + 20 * i,
                        .led_index = i == 1 ? -1 : 8 + i};
    spots[i] = spot;
  }
  m->spots._length = m->spots._maximum = 3;
  m->spots._buffer = spots;
}

static void FillInclination(tbm_v1_Inclination* m) {
  strcpy(m->machine_id, "machine-8");
  strcpy(m->sensor, "camera");
  m->sensed_at_utc_ns = 1700000000000000021;
  m->published_at_utc_ns = 1700000000000000022;
  m->sample_number = 23000000000u;
  m->validity = tbm_v1_TILT_DEGRADED;
  strcpy(m->reason, "vibration");
  m->beta_rad = 0.0241;
  m->gamma_rad = -0.0252;
  m->sigma_rad = 0.000263;
}

static void FillPose(tbm_v1_RelativePose* m, tbm_v1_PosePoint* points) {
  strcpy(m->machine_id, "machine-9");
  m->sensed_at_utc_ns = 1700000000000000031;
  m->published_at_utc_ns = 1700000000000000032;
  m->sample_number = 33000000000u;
  strcpy(m->rig_hash, "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef");
  m->status = tbm_v1_POSE_STATUS_DEGRADED;
  m->reason = tbm_v1_POSE_REASON_LED_EXCLUDED;
  strcpy(m->reason_code, "led_excluded");
  m->camera_from_target_qw = 0.5;
  m->camera_from_target_qx = 0.1;
  m->camera_from_target_qy = -0.7;
  m->camera_from_target_qz = 0.5;
  m->camera_from_target_translation_m[0] = 0.341;
  m->camera_from_target_translation_m[1] = -0.342;
  m->camera_from_target_translation_m[2] = 3.43;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      m->covariance[6 * i + j] = (i == j ? 1e-3 * (i + 1) : 1e-5 * (i + j)) + 1e-11 * (6 * i + j);
    }
  }
  m->leds_used = 4;
  m->leds_used_mask = 0x80000015u;
  m->excluded_led_index = 3;
  m->tilts_used = true;
  m->chi2 = 35.5;
  m->dof = 36;
  m->rms_px = 0.037;
  for (int i = 0; i < 2; ++i) {
    strcpy(points[i].name, i == 0 ? "shield_head" : "shield_tail");
    points[i].in_camera_m[0] = 40.1 + 10 * i;
    points[i].in_camera_m[1] = 40.2 + 10 * i;
    points[i].in_camera_m[2] = 40.3 + 10 * i;
    points[i].sigma_m = 0.0404 + i;
    points[i].bound_m = i == 0 ? 0.0405 : NAN;
  }
  m->points._length = m->points._maximum = 2;
  m->points._buffer = points;
}

static void FillHealth(tbm_v1_DeviceHealth* m) {
  strcpy(m->machine_id, "machine-10");
  strcpy(m->device_id, "inclinometer_target");
  m->published_at_utc_ns = 1700000000000000051;
  m->state = tbm_v1_DEVICE_SILENT;
  m->state_since_utc_ns = 1700000000000000049;
  m->samples_good = 52000000000u;
  m->samples_lost = 53;
  m->errors = 54;
  m->reconnects = 55;
  strcpy(m->detail, "no answer on the serial line for 1.2 s; is the plug in?");
}

static void FillEvent(tbm_v1_Event* m) {
  strcpy(m->machine_id, "machine-11");
  strcpy(m->source, "camera_box");
  strcpy(m->code, "mounting_moved");
  m->at_utc_ns = 1700000000000000061;
  m->sample_number = 62000000000u;
  m->severity = tbm_v1_EVENT_WARNING;
  m->active = true;
  strcpy(m->text, "the target's inclinometer no longer agrees with the image: 0.05 degree");
}

static void Text(const char* field, const char* value) { printf("%s=%s\n", field, value); }
static void Whole(const char* field, int64_t value) { printf("%s=%" PRId64 "\n", field, value); }
static void Number(const char* field, double value) {
  if (isnan(value)) {
    printf("%s=nan\n", field);
  } else {
    printf("%s=%.17g\n", field, value);
  }
}
static const char* Indexed(const char* format, unsigned index) {
  static char name[64];
  snprintf(name, sizeof name, format, index);
  return name;
}

static void PrintFeatures(const tbm_v1_FrameFeatures* m) {
  Text("features.machine_id", m->machine_id);
  Whole("features.sensed_at_utc_ns", m->sensed_at_utc_ns);
  Whole("features.published_at_utc_ns", m->published_at_utc_ns);
  Whole("features.frame_number", (int64_t)m->frame_number);
  Number("features.exposure_s", m->exposure_s);
  Text("features.reason", m->reason);
  Number("features.background_dn", m->background_dn);
  Number("features.noise_dn", m->noise_dn);
  Whole("features.rejected_spots", m->rejected_spots);
  Whole("features.dropped_spots", m->dropped_spots);
  Whole("features.frames_received", (int64_t)m->frames_received);
  Whole("features.frames_lost", (int64_t)m->frames_lost);
  Whole("features.frames_damaged", (int64_t)m->frames_damaged);
  Whole("features.frames_skipped", (int64_t)m->frames_skipped);
  for (unsigned i = 0; i < m->spots._length; ++i) {
    const tbm_v1_Spot* s = &m->spots._buffer[i];
    Number(Indexed("features.spot%u.u_px", i), s->u_px);
    Number(Indexed("features.spot%u.v_px", i), s->v_px);
    Number(Indexed("features.spot%u.sigma_px", i), s->sigma_px);
    Number(Indexed("features.spot%u.peak_dn", i), s->peak_dn);
    Number(Indexed("features.spot%u.background_dn", i), s->background_dn);
    Number(Indexed("features.spot%u.spread_px", i), s->spread_px);
    Number(Indexed("features.spot%u.elongation", i), s->elongation);
    Whole(Indexed("features.spot%u.clipped_pixels", i), s->clipped_pixels);
    Whole(Indexed("features.spot%u.led_index", i), s->led_index);
  }
  printf("features.end\n");
}

static void PrintInclination(const tbm_v1_Inclination* m) {
  Text("inclination.machine_id", m->machine_id);
  Text("inclination.sensor", m->sensor);
  Whole("inclination.sensed_at_utc_ns", m->sensed_at_utc_ns);
  Whole("inclination.published_at_utc_ns", m->published_at_utc_ns);
  Whole("inclination.sample_number", (int64_t)m->sample_number);
  Whole("inclination.validity", m->validity);
  Text("inclination.reason", m->reason);
  Number("inclination.beta_rad", m->beta_rad);
  Number("inclination.gamma_rad", m->gamma_rad);
  Number("inclination.sigma_rad", m->sigma_rad);
  printf("inclination.end\n");
}

static void PrintPose(const tbm_v1_RelativePose* m) {
  Text("pose.machine_id", m->machine_id);
  Whole("pose.sensed_at_utc_ns", m->sensed_at_utc_ns);
  Whole("pose.published_at_utc_ns", m->published_at_utc_ns);
  Whole("pose.sample_number", (int64_t)m->sample_number);
  Text("pose.rig_hash", m->rig_hash);
  Whole("pose.status", m->status);
  Whole("pose.reason", m->reason);
  Text("pose.reason_code", m->reason_code);
  Number("pose.qw", m->camera_from_target_qw);
  Number("pose.qx", m->camera_from_target_qx);
  Number("pose.qy", m->camera_from_target_qy);
  Number("pose.qz", m->camera_from_target_qz);
  for (unsigned i = 0; i < 3; ++i) {
    Number(Indexed("pose.t%u_m", i), m->camera_from_target_translation_m[i]);
  }
  for (unsigned i = 0; i < 36; ++i) Number(Indexed("pose.covariance%u", i), m->covariance[i]);
  Whole("pose.leds_used", m->leds_used);
  Whole("pose.leds_used_mask", m->leds_used_mask);
  Whole("pose.excluded_led_index", m->excluded_led_index);
  Whole("pose.tilts_used", m->tilts_used);
  Number("pose.chi2", m->chi2);
  Whole("pose.dof", m->dof);
  Number("pose.rms_px", m->rms_px);
  for (unsigned i = 0; i < m->points._length; ++i) {
    const tbm_v1_PosePoint* p = &m->points._buffer[i];
    Text(Indexed("pose.point%u.name", i), p->name);
    Number(Indexed("pose.point%u.x_m", i), p->in_camera_m[0]);
    Number(Indexed("pose.point%u.y_m", i), p->in_camera_m[1]);
    Number(Indexed("pose.point%u.z_m", i), p->in_camera_m[2]);
    Number(Indexed("pose.point%u.sigma_m", i), p->sigma_m);
    Number(Indexed("pose.point%u.bound_m", i), p->bound_m);
  }
  printf("pose.end\n");
}

static void PrintHealth(const tbm_v1_DeviceHealth* m) {
  Text("health.machine_id", m->machine_id);
  Text("health.device_id", m->device_id);
  Whole("health.published_at_utc_ns", m->published_at_utc_ns);
  Whole("health.state", m->state);
  Whole("health.state_since_utc_ns", m->state_since_utc_ns);
  Whole("health.samples_good", (int64_t)m->samples_good);
  Whole("health.samples_lost", (int64_t)m->samples_lost);
  Whole("health.errors", (int64_t)m->errors);
  Whole("health.reconnects", (int64_t)m->reconnects);
  Text("health.detail", m->detail);
  printf("health.end\n");
}

static void PrintEvent(const tbm_v1_Event* m) {
  Text("event.machine_id", m->machine_id);
  Text("event.source", m->source);
  Text("event.code", m->code);
  Whole("event.at_utc_ns", m->at_utc_ns);
  Whole("event.sample_number", (int64_t)m->sample_number);
  Whole("event.severity", m->severity);
  Whole("event.active", m->active);
  Text("event.text", m->text);
  printf("event.end\n");
}

static void Print(int topic, const void* sample) {
  switch (topic) {
    case kFeatures:
      PrintFeatures(sample);
      break;
    case kInclination:
      PrintInclination(sample);
      break;
    case kPose:
      PrintPose(sample);
      break;
    case kHealth:
      PrintHealth(sample);
      break;
    default:
      PrintEvent(sample);
      break;
  }
  fflush(stdout);
}

static int Write(dds_entity_t participant) {
  static tbm_v1_Spot spots[3];
  static tbm_v1_PosePoint points[2];
  static tbm_v1_FrameFeatures features;
  static tbm_v1_Inclination inclination;
  static tbm_v1_RelativePose pose;
  static tbm_v1_DeviceHealth health;
  static tbm_v1_Event event;
  const void* const samples[kTopics] = {&features, &inclination, &pose, &health, &event};
  dds_entity_t writers[kTopics];
  FillFeatures(&features, spots);
  FillInclination(&inclination);
  FillPose(&pose, points);
  FillHealth(&health);
  FillEvent(&event);
  for (int topic = 0; topic < kTopics; ++topic) {
    dds_qos_t* qos = ClassQos(topic);
    const dds_entity_t t =
        dds_create_topic(participant, Descriptor(topic), kNames[topic], NULL, NULL);
    writers[topic] = dds_create_writer(participant, t, qos, NULL);
    dds_delete_qos(qos);
    if (writers[topic] < 0) return 4;
  }
  for (int topic = 0; topic < kTopics; ++topic) {
    dds_publication_matched_status_t matched = {0};
    for (int wait = 0; wait < 1000 && matched.current_count == 0; ++wait) {
      dds_get_publication_matched_status(writers[topic], &matched);
      dds_sleepfor(DDS_MSECS(10));
    }
    if (matched.current_count == 0) return 5;
  }
  for (int topic = 0; topic < kTopics; ++topic) {
    if (dds_write(writers[topic], samples[topic]) != DDS_RETCODE_OK) return 6;
  }
  printf("written\n");
  fflush(stdout);
  dds_sleepfor(DDS_SECS(30)); /* the test ends this process when it has what it wants */
  return 0;
}

static int Read(dds_entity_t participant) {
  dds_entity_t readers[kTopics];
  for (int topic = 0; topic < kTopics; ++topic) {
    dds_qos_t* qos = ClassQos(topic);
    const dds_entity_t t =
        dds_create_topic(participant, Descriptor(topic), kNames[topic], NULL, NULL);
    readers[topic] = dds_create_reader(participant, t, qos, NULL);
    dds_delete_qos(qos);
    if (readers[topic] < 0) return 4;
  }
  int missing = kTopics;
  bool has_come[kTopics] = {false};
  for (int wait = 0; wait < 3000 && missing > 0; ++wait) {
    for (int topic = 0; topic < kTopics; ++topic) {
      void* sample = NULL;
      dds_sample_info_t info;
      if (dds_take(readers[topic], &sample, &info, 1, 1) != 1) continue;
      if (info.valid_data && !has_come[topic]) {
        Print(topic, sample);
        has_come[topic] = true;
        --missing;
      }
      dds_return_loan(readers[topic], &sample, 1);
    }
    dds_sleepfor(DDS_MSECS(10));
  }
  return missing == 0 ? 0 : 5;
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const dds_entity_t participant =
      dds_create_participant((dds_domainid_t)atoi(argv[2]), NULL, NULL);
  if (participant < 0) return 4;
  const int code = strcmp(argv[1], "write") == 0 ? Write(participant) : Read(participant);
  dds_delete(participant);
  return code;
}
