#include "pose/app/self_test.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

// A clock that says less has no battery and no time server: this program is younger.
constexpr Timestamp kProgramIsYounger{1'767'225'600'000'000'000};  // 2026-01-01
// The packets' own headers, and what a link can really carry.
constexpr double kPacketOverhead = 1.05;
constexpr double kUsableLink = 0.9;
constexpr int kFullPacketBytes = 1400;  // an ordinary network carries so much at least
// Centres are proven for spots of 1.5 .. 4 px (pose/docs/centres.md).
constexpr double kSharpestSpread_px = 0.9;
constexpr double kWidestSpread_px = 5.0;
constexpr double kLongestElongation = 1.6;
constexpr double kDarkest = 0.35;  // of full scale; exposure control aims at 0.4 .. 0.9
constexpr double kBrightest = 0.95;
constexpr double kSeenOften = 0.8;  // part of the frames
constexpr double kTiltTooFar_deg = 15.0;
constexpr double kTiltScatter = 6.0;                          // times the rig's sigma
constexpr std::string_view kDeliveredRig = "NOT_CALIBRATED";  // tools/package/box/rig.yaml
constexpr double kGoodReadings = 0.97;
constexpr double kShareLost = 0.001;

void Add(std::vector<Finding>& findings,
         Verdict verdict,
         std::string part,
         std::string text,
         std::string remedy = {}) {
  findings.push_back({verdict, std::move(part), std::move(text), std::move(remedy)});
}

std::string RemedyFor(CameraFailure failure, const BoxConfig& config) {
  switch (failure) {
    case CameraFailure::kUnreachable:
      return fmt::format(
          "is the camera powered, is the cable in, is its address really {}? The camera's own lamp "
          "must be lit; try another port of the switch",
          config.camera.address);
    case CameraFailure::kInUse:
      return "another program has it: stop the service first (systemctl stop tbm-camera-box)";
    case CameraFailure::kRefused:
      return "the camera answers but does not accept a setting: see the text, and camera_box.yaml";
    case CameraFailure::kBadRun:
    case CameraFailure::kEndOfRun:
      return "camera.driver is replay: for a live test it must be gige";
    case CameraFailure::kNoFrameInTime:
    case CameraFailure::kSilent:
    case CameraFailure::kLost:
      return "connected, but no images come: look at cable and switch; is a firewall in the way?";
  }
  return {};
}

std::string RemedyFor(InclinometerFailure failure, const InclinometerConfig& config) {
  const std::string& port = config.port.path;
  switch (failure) {
    case InclinometerFailure::kPortMissing:
      return fmt::format("there is no {}: is the serial adapter plugged in? ls -l /dev/tbm", port);
    case InclinometerFailure::kPortRefused:
      return fmt::format(
          "{} may not be opened: another program has it (systemctl stop tbm-camera-box), or this "
          "user is not in the group dialout",
          port);
    case InclinometerFailure::kHungUp:
      return fmt::format("{} went away: the adapter was unplugged or lost its supply", port);
    case InclinometerFailure::kNoReply:
      return fmt::format(
          "no answer: supply of the instrument, wires A and B swapped, baud rate ({}), address "
          "({})",
          config.port.baud,
          config.address);
    case InclinometerFailure::kGarbled:
      return "answers are damaged: termination, shield, two instruments with one address, baud "
             "rate";
    case InclinometerFailure::kOtherInstrument:
      return fmt::format("an instrument with another address answers; {} is configured",
                         config.address);
    case InclinometerFailure::kException:
      return "the instrument refuses the question: registers or function in camera_box.yaml";
    case InclinometerFailure::kNotFinite:
    case InclinometerFailure::kFrozen:
      return "the instrument answers but does not measure: exchange it";
    case InclinometerFailure::kOutOfRange:
    case InclinometerFailure::kStep:
      return "the angles are impossible: register format and scale in camera_box.yaml, or mounting";
    case InclinometerFailure::kNotDue:
    case InclinometerFailure::kEnded:
      break;
  }
  return {};
}

std::string RemedyFor(PoseReason reason) {
  switch (reason) {
    case PoseReason::kFrameDark:
      return "nothing shines: are the LEDs switched on, is the lens cap off, is the window clean?";
    case PoseReason::kFrameSaturated:
      return "nearly all of the image is white: a lamp shines into the lens";
    case PoseReason::kFrameSize:
      return "the image is not of the size that rig.yaml is for: other camera, or binning is on";
    case PoseReason::kTooFewLeds:
    case PoseReason::kFewLeds:
    case PoseReason::kTwoLeds:
      return "LEDs are covered, dirty or off: see the lines of the LEDs";
    case PoseReason::kNoMatch:
    case PoseReason::kAmbiguous:
      return "spots are seen but do not fit the target: is rig.yaml the one of this machine?";
    case PoseReason::kTiltMissing:
    case PoseReason::kTiltStale:
    case PoseReason::kTiltNotFinite:
    case PoseReason::kTiltOutOfRange:
      return "an inclinometer is missing: see its line";
    case PoseReason::kTiltDisagrees:
    case PoseReason::kInconsistent:
    case PoseReason::kLedExcluded:
    case PoseReason::kMountingMoved:
      return "image and inclinometers contradict each other: an inclinometer was moved, two are "
             "exchanged, or rig.yaml is of another machine";
    default:
      return {};
  }
}

// The commonest reason that is not kNone.
template <std::size_t n>
PoseReason Commonest(const std::array<int, n>& counts) {
  const auto most = std::max_element(counts.begin() + 1, counts.end());
  return *most == 0 ? PoseReason::kNone : static_cast<PoseReason>(most - counts.begin());
}

double FullScale(PixelFormat format) {
  switch (format) {
    case PixelFormat::kMono8:
      return 255.0;
    case PixelFormat::kMono12:
      return 4095.0;
    case PixelFormat::kMono16:
      return 65535.0;
  }
  return 255.0;
}

void JudgeLink(const HostFacts& host,
               const BoxConfig& config,
               const Rig& rig,
               std::vector<Finding>& findings) {
  if (config.camera.driver != CameraDriver::kGige) return;
  if (!host.camera_link) {
    Add(findings,
        Verdict::kBad,
        "camera link",
        fmt::format("no network interface of this box is in the subnet of {}",
                    config.camera.address),
        "give the interface at the camera an address of that subnet, or correct camera.address");
    return;
  }
  const CameraLink& link = *host.camera_link;
  if (link.is_loopback) {
    Add(findings, Verdict::kGood, "camera link", "the camera is a program on this computer");
    return;
  }
  if (!link.has_carrier || !link.speed_mbit_s) {
    Add(findings,
        Verdict::kBad,
        "camera link",
        fmt::format("{} has no link", link.interface),
        "cable not plugged in, broken, or no power at the other end");
    return;
  }
  const double bytes_per_pixel = config.camera.pixel_format == PixelFormat::kMono8 ? 1.0 : 2.0;
  const double needed_mbit_s = 8e-6 * kPacketOverhead * bytes_per_pixel *
                               rig.camera.image_width_px * rig.camera.image_height_px *
                               config.camera.frame_rate_hz;
  const bool is_enough = needed_mbit_s < kUsableLink * *link.speed_mbit_s;
  Add(findings,
      is_enough ? Verdict::kGood : Verdict::kBad,
      "camera link",
      fmt::format("{}: {} Mbit/s, {:.0f} needed, packets up to {} bytes",
                  link.interface,
                  *link.speed_mbit_s,
                  needed_mbit_s,
                  link.mtu_bytes),
      is_enough ? ""
                : "one pair of the cable is broken or the switch is slow: all must be gigabit; or "
                  "lower camera.frame_rate_hz");
}

}  // namespace

void SelfTestCollector::Publish(const dds::FrameFeatures& message) {
  const std::lock_guard lock(mutex_);
  ++seen_.frames;
  ++seen_.frames_with_reason.at(static_cast<std::size_t>(message.reason));
  seen_.exposure_s = message.exposure_s;
  for (const dds::Spot& spot : message.spots) {
    if (spot.led_index < 0 || spot.led_index >= static_cast<int>(seen_.leds.size())) continue;
    Led& led = seen_.leds[static_cast<std::size_t>(spot.led_index)];
    ++led.frames;
    led.frames_clipped += spot.centre.clipped_pixels > 0 ? 1 : 0;
    led.sum_level_dn += spot.centre.peak_dn + spot.centre.background_dn;
    led.sum_spread_px += spot.centre.spread_px;
    led.sum_elongation += spot.centre.elongation;
  }
}

void SelfTestCollector::Publish(const dds::TiltReading& message) {
  if (message.validity == dds::Validity::kInvalid) return;
  const std::lock_guard lock(mutex_);
  Tilt& tilt = seen_.tilts[message.sensor == "target" ? 0 : 1];
  const std::array angles_rad = {message.inclination.beta_rad, message.inclination.gamma_rad};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const double step_rad = angles_rad[axis] - tilt.last_rad[axis];
    if (tilt.readings > 0) tilt.sum_steps_rad2[axis] += step_rad * step_rad;
    tilt.sum_rad[axis] += angles_rad[axis];
  }
  tilt.last_rad = angles_rad;
  ++tilt.readings;
}

void SelfTestCollector::Publish(const dds::RelativePose& message) {
  const std::lock_guard lock(mutex_);
  ++seen_.poses_with_reason.at(static_cast<std::size_t>(message.reason));
  switch (message.status) {
    case PoseStatus::kOk:
      ++seen_.poses_ok;
      break;
    case PoseStatus::kDegraded:
      ++seen_.poses_degraded;
      break;
    case PoseStatus::kNone:
      ++seen_.poses_none;
      return;
  }
  seen_.last_pose = message;
}

SelfTestCollector::Seen SelfTestCollector::seen() const {
  const std::lock_guard lock(mutex_);
  return seen_;
}

void SelfTestCollector::Restart() {
  const std::lock_guard lock(mutex_);
  seen_ = {};
}

std::vector<Finding> JudgeHost(const HostFacts& host, const BoxConfig& config, const Rig& rig) {
  std::vector<Finding> findings;
  if (rig.name == kDeliveredRig) {
    Add(findings,
        Verdict::kBad,
        "rig file",
        fmt::format("{} is still the one of the package, measured on no machine", config.rig_file),
        "put the calibration of this box there");
  }
  if (host.now < kProgramIsYounger) {
    Add(findings,
        Verdict::kBad,
        "clock",
        "the box's clock stands before 2026",
        "no time server is reached and the clock's battery is empty or absent: timedatectl");
  } else if (!host.is_clock_synchronised) {
    Add(findings,
        Verdict::kDoubtful,
        "clock",
        "no time server steers the clock; stamps drift by seconds a day",
        "name a time server in /etc/systemd/timesyncd.conf; timedatectl shows the state");
  } else {
    Add(findings, Verdict::kGood, "clock", "steered by a time server");
  }

  if (config.recording.folder.empty()) {
    Add(findings, Verdict::kGood, "disk", "nothing is recorded (recording.folder is not set)");
  } else if (!host.recording_free_bytes || !host.is_recording_writable) {
    Add(findings,
        Verdict::kBad,
        "disk",
        fmt::format("{} cannot be written", config.recording.folder),
        "is the card in, mounted and not read-only? The folder must belong to tbm-camera-box");
  } else {
    const bool is_enough = *host.recording_free_bytes > config.recording.limit_bytes;
    Add(findings,
        is_enough ? Verdict::kGood : Verdict::kDoubtful,
        "disk",
        fmt::format("{:.1f} GB free, recordings may take {:.1f} GB",
                    1e-9 * static_cast<double>(*host.recording_free_bytes),
                    1e-9 * static_cast<double>(config.recording.limit_bytes)),
        is_enough ? "" : "a larger card, or a smaller recording.limit_mb");
  }

  if (host.dds_addresses_missing.empty()) {
    const bool is_local = std::all_of(
        config.dds.interfaces.begin(), config.dds.interfaces.end(), [](const std::string& address) {
          return address.rfind("127.", 0) == 0;
        });
    Add(findings,
        is_local ? Verdict::kDoubtful : Verdict::kGood,
        "DDS",
        fmt::format("domain {} on {}", config.dds.domain, fmt::join(config.dds.interfaces, ", ")),
        is_local ? "nobody outside this box hears it: put the box's own address in dds.interfaces"
                 : "");
  } else {
    Add(findings,
        Verdict::kBad,
        "DDS",
        fmt::format("this box does not have the address {}",
                    fmt::join(host.dds_addresses_missing, ", ")),
        "correct dds.interfaces, or plug in that network; `ip -4 addr` lists what there is");
  }

  JudgeLink(host, config, rig, findings);
  if (config.camera.driver == CameraDriver::kGige &&
      host.receive_buffer_max_bytes < config.camera.socket_buffer_bytes) {
    Add(findings,
        Verdict::kDoubtful,
        "socket buffer",
        fmt::format("the kernel grants {} bytes, camera.socket_buffer_bytes asks for {}",
                    host.receive_buffer_max_bytes,
                    config.camera.socket_buffer_bytes),
        "net.core.rmem_max is set by the package: `sysctl --system` puts it in force");
  }
  return findings;
}

std::vector<Finding> JudgeCamera(const MeasuredSpan& span,
                                 const SelfTestCollector::Seen& seen,
                                 const BoxConfig& config) {
  std::vector<Finding> findings;
  const CameraHealth& camera = span.camera;
  const std::uint64_t frames = camera.frames - span.camera_before.frames;
  if (camera.state != CameraState::kStreaming || frames == 0) {
    const CameraFailure failure = camera.failure.value_or(CameraFailure::kSilent);
    Add(findings,
        Verdict::kBad,
        "camera",
        fmt::format(
            "{}{}{}", FailureCode(failure), camera.detail.empty() ? "" : ": ", camera.detail),
        RemedyFor(failure, config));
    return findings;
  }
  const double rate_hz = static_cast<double>(frames) / span.seconds;
  const bool is_slow = rate_hz < 0.9 * config.camera.frame_rate_hz;
  Add(findings,
      is_slow ? Verdict::kDoubtful : Verdict::kGood,
      "camera",
      fmt::format("{:.1f} images/s of {:.1f}, exposure {:.2f} ms",
                  rate_hz,
                  config.camera.frame_rate_hz,
                  1e3 * seen.exposure_s),
      is_slow ? "the camera sends fewer than it is asked for: exposure too long, or link too slow"
              : "");

  const std::uint64_t lost =
      camera.lost - span.camera_before.lost + camera.incomplete - span.camera_before.incomplete;
  const bool is_lossy = static_cast<double>(lost) > kShareLost * static_cast<double>(frames + lost);
  Add(findings,
      is_lossy ? Verdict::kDoubtful : Verdict::kGood,
      "image transfer",
      fmt::format("{} of {} images lost or damaged", lost, frames + lost),
      is_lossy ? "cable, plugs, switch; the camera's link should carry nothing else" : "");
  if (config.camera.driver == CameraDriver::kGige && camera.packet_size_bytes < kFullPacketBytes) {
    Add(findings,
        Verdict::kDoubtful,
        "packet size",
        fmt::format("only {} bytes come through", camera.packet_size_bytes),
        "something between box and camera splits packets: its MTU should be 1500 or more");
  }
  return findings;
}

std::vector<Finding> JudgeLeds(const SelfTestCollector::Seen& seen,
                               const BoxConfig& config,
                               const Rig& rig) {
  std::vector<Finding> findings;
  if (seen.frames == 0) return findings;
  const double full_dn = FullScale(config.camera.pixel_format);
  for (std::size_t i = 0; i < rig.leds.size(); ++i) {
    const SelfTestCollector::Led& led = seen.leds[i];
    const std::string part = fmt::format("LED {}", rig.leds[i].id);
    if (led.frames < kSeenOften * seen.frames) {
      Add(findings,
          led.frames == 0 ? Verdict::kBad : Verdict::kDoubtful,
          part,
          led.frames == 0 ? "not seen"
                          : fmt::format("seen in {} of {} images only", led.frames, seen.frames),
          "is it lit, clean, and not covered from where the camera is?");
      if (led.frames == 0) continue;
    }
    const double level = led.sum_level_dn / led.frames / full_dn;
    const double spread_px = led.sum_spread_px / led.frames;
    const double elongation = led.sum_elongation / led.frames;
    const std::string seen_as =
        fmt::format("peak {:.0f} % of full scale, spread {:.1f} px, elongation {:.2f}",
                    100.0 * level,
                    spread_px,
                    elongation);
    const bool at_shortest = 1e6 * seen.exposure_s <= 1.05 * config.camera.exposure_min_us;
    const bool at_longest = 1e6 * seen.exposure_s >= 0.95 * config.camera.exposure_max_us;
    if (2 * led.frames_clipped > led.frames || level > kBrightest) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as + ": too bright",
          at_shortest ? "the exposure is at its shortest: close the lens' aperture"
                      : "brighter than the other LEDs: lower its current");
    } else if (level < kDarkest) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as + ": too dark",
          at_longest ? "the exposure is at its longest: open the aperture, clean lens and window"
                     : "darker than the other LEDs: dirty, or its current is too low");
    }
    if (spread_px > kWidestSpread_px) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as + ": out of focus",
          "focus the lens at the target; a wet or fogged window does the same");
    } else if (spread_px < kSharpestSpread_px) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as + ": smaller than a pixel",
          "defocus the lens a little: centres are exact from a spread of 1.5 px on");
    } else if (elongation > kLongestElongation) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as + ": not round",
          "a drop or scratch on the window, a reflection beside the LED, or strong vibration");
    }
    if (findings.empty() || findings.back().part != part) {
      Add(findings, Verdict::kGood, part, seen_as);
    }
  }
  return findings;
}

std::vector<Finding> JudgeTilts(const MeasuredSpan& span,
                                const SelfTestCollector::Seen& seen,
                                const BoxConfig& config,
                                const Rig& rig) {
  std::vector<Finding> findings;
  for (std::size_t i = 0; i < 2; ++i) {
    const InclinometerConfig& wanted =
        i == 0 ? config.target_inclinometer : config.camera_inclinometer;
    const std::string part = i == 0 ? "inclinometer target" : "inclinometer camera";
    const InclinometerHealth& health = span.tilt[i];
    const InclinometerCounters& now = health.counters;
    const InclinometerCounters& before = span.tilt_before[i].counters;
    const auto good = static_cast<double>(now.good - before.good);
    if (health.state != InclinometerState::kStreaming || good == 0.0) {
      const InclinometerFailure failure =
          health.last_failure.value_or(InclinometerFailure::kNoReply);
      Add(findings,
          Verdict::kBad,
          part,
          fmt::format("{} at {}", FailureCode(failure), wanted.port.path),
          RemedyFor(failure, wanted));
      continue;
    }
    const SelfTestCollector::Tilt& tilt = seen.tilts[i];
    const double sigma_rad = i == 0 ? rig.target_tilt.sigma_rad : rig.camera_tilt.sigma_rad;
    // Of neighbouring readings: a machine that leans over slowly does not count.
    double scatter_rad = 0.0;
    for (const double sum : tilt.sum_steps_rad2) {
      scatter_rad = std::max(scatter_rad, std::sqrt(0.5 * sum / std::max(tilt.readings - 1, 1)));
    }
    const double count = std::max(tilt.readings, 1);
    const double mean_rad[2] = {tilt.sum_rad[0] / count, tilt.sum_rad[1] / count};
    const std::string seen_as = fmt::format(
        "beta {:.3f} degree, gamma {:.3f} degree, scatter {:.4f} degree, {:.0f} readings/s",
        RadToDeg(mean_rad[0]),
        RadToDeg(mean_rad[1]),
        RadToDeg(scatter_rad),
        good / span.seconds);
    const auto bad = static_cast<double>(now.no_reply - before.no_reply + now.garbled -
                                         before.garbled + now.implausible - before.implausible);
    if (good < kGoodReadings * (good + bad)) {
      const InclinometerFailure worst =
          now.garbled - before.garbled > now.no_reply - before.no_reply
              ? InclinometerFailure::kGarbled
              : InclinometerFailure::kNoReply;
      Add(findings,
          Verdict::kDoubtful,
          part,
          fmt::format(
              "{}; {:.0f} of {:.0f} questions without a good answer", seen_as, bad, good + bad),
          RemedyFor(worst, wanted));
    } else if (std::max(std::abs(mean_rad[0]), std::abs(mean_rad[1])) > DegToRad(kTiltTooFar_deg)) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          seen_as,
          "a shield does not stand like that: is it mounted the way rig.yaml says?");
    } else if (scatter_rad > kTiltScatter * sigma_rad) {
      Add(findings,
          Verdict::kDoubtful,
          part,
          fmt::format("{}; rig.yaml says {:.4f}", seen_as, RadToDeg(sigma_rad)),
          "the machine moves or vibrates, or the mounting is loose; repeat at standstill");
    } else {
      Add(findings, Verdict::kGood, part, seen_as);
    }
  }
  return findings;
}

std::vector<Finding> JudgePose(const SelfTestCollector::Seen& seen) {
  std::vector<Finding> findings;
  const int poses = seen.poses_ok + seen.poses_degraded + seen.poses_none;
  if (poses == 0) return findings;
  const PoseReason reason = Commonest(seen.poses_with_reason);
  const std::string counts = fmt::format(
      "{} ok, {} degraded, {} none", seen.poses_ok, seen.poses_degraded, seen.poses_none);
  if (seen.poses_ok > kSeenOften * poses && seen.last_pose) {
    std::string where;
    if (!seen.last_pose->points.empty()) {
      const dds::PosePoint& point = seen.last_pose->points[0];
      where = fmt::format("; {} at {:.1f}, {:.1f}, {:.1f} mm from the camera, sigma {:.2f} mm",
                          point.name.view(),
                          1e3 * point.p_in_camera.x(),
                          1e3 * point.p_in_camera.y(),
                          1e3 * point.p_in_camera.z(),
                          1e3 * point.sigma_m);
    }
    Add(findings, Verdict::kGood, "pose", counts + where);
    return findings;
  }
  const bool is_bad = seen.poses_ok + seen.poses_degraded == 0;
  Add(findings,
      is_bad ? Verdict::kBad : Verdict::kDoubtful,
      "pose",
      fmt::format("{}, mostly {}", counts, ReasonCode(reason)),
      RemedyFor(reason));
  return findings;
}

std::string ReportText(const std::vector<Finding>& findings) {
  std::string text;
  int doubtful = 0;
  int bad = 0;
  for (const Finding& finding : findings) {
    const char* word = "good ";
    if (finding.verdict == Verdict::kDoubtful) {
      word = "DOUBT";
      ++doubtful;
    } else if (finding.verdict == Verdict::kBad) {
      word = "BAD  ";
      ++bad;
    }
    text += fmt::format("{}  {:<20} {}\n", word, finding.part, finding.text);
    if (!finding.remedy.empty()) text += fmt::format("{:28}-> {}\n", "", finding.remedy);
  }
  text += bad == 0 && doubtful == 0
              ? "The box is ready.\n"
              : fmt::format("{} bad, {} doubtful.{}\n",
                            bad,
                            doubtful,
                            bad == 0 ? " The box works." : " The box is not ready.");
  return text;
}

}  // namespace tbm
