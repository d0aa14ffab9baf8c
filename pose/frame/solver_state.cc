#include <array>
#include <cstdio>
#include <cstdlib>

#include "pose/frame/frame_solver.h"

namespace tbm {
namespace {

constexpr std::string_view kHeading = "tbm_solver_state 2";

// "%a" prints a double in hexadecimal: every bit comes back.
void Append(std::string& text, double value) {
  std::array<char, 40> buffer{};
  std::snprintf(buffer.data(), buffer.size(), " %a", value);
  text += buffer.data();
}

std::string Flag(bool flag) { return flag ? " 1" : " 0"; }

// Reads one blank and one number at `*place`, and moves it on.
template <class Number, class Convert>
bool Take(const char** place, Number* value, Convert convert) {
  if (**place != ' ') return false;
  char* end = nullptr;
  *value = convert(*place + 1, &end);
  if (end == *place + 1) return false;
  *place = end;
  return true;
}

bool TakeStamp(const char** place, Timestamp* stamp) {
  return Take(
      place, &stamp->ns, [](const char* text, char** end) { return std::strtoll(text, end, 10); });
}

// Takes a flag; false when it is neither 0 nor 1.
bool TakeFlag(const char** place, bool* flag) {
  Timestamp number;
  if (!TakeStamp(place, &number) || (number.ns != 0 && number.ns != 1)) return false;
  *flag = number.ns == 1;
  return true;
}

bool TakeNumbers(const char** place, double* numbers, std::ptrdiff_t count) {
  for (std::ptrdiff_t i = 0; i < count; ++i) {
    if (!Take(place, numbers + i, [](const char* text, char** end) {
          return std::strtod(text, end);
        })) {
      return false;
    }
  }
  return true;
}

void AppendNumbers(std::string& text, const double* numbers, std::ptrdiff_t count) {
  for (std::ptrdiff_t i = 0; i < count; ++i) Append(text, numbers[i]);
}

}  // namespace

std::string FrameSolver::BeginRecord() {
  std::string text(kHeading);
  text += Flag(last_sensed_at_.has_value());
  text += " " + std::to_string(last_sensed_at_ ? last_sensed_at_->ns : 0);
  text += Flag(accepted_.has_value());
  if (accepted_) {
    text += " " + std::to_string(accepted_->sensed_at.ns);
    AppendNumbers(text, accepted_->camera_from_target.translation.data(), 3);
    AppendNumbers(text, accepted_->camera_from_target.rotation.coeffs().data(), 4);
    AppendNumbers(text, accepted_->covariance.data(), 36);
    for (const Inclination* tilt : {&accepted_->target_tilt, &accepted_->camera_tilt}) {
      Append(text, tilt->beta_rad);
      Append(text, tilt->gamma_rad);
    }
  }
  const auto baseline = monitor_.baseline();
  text += Flag(mounting_moved_);
  text += Flag(baseline.has_value());
  if (baseline) {
    AppendNumbers(text, baseline->offset_rad.data(), baseline->offset_rad.size());
    AppendNumbers(text, baseline->covariance.data(), baseline->covariance.size());
    AppendNumbers(text, baseline->by_centres.data(), baseline->by_centres.size());
  }
  monitor_.Restart(baseline);
  return text + "\n";
}

bool FrameSolver::RestoreState(const std::string& state) {
  if (state.compare(0, kHeading.size(), kHeading) != 0) return false;
  const char* place = state.c_str() + kHeading.size();
  bool has_stamp = false;
  Timestamp stamp;
  bool has_pose = false;
  if (!TakeFlag(&place, &has_stamp) || !TakeStamp(&place, &stamp) || !TakeFlag(&place, &has_pose)) {
    return false;
  }
  AcceptedPose pose;
  if (has_pose) {
    std::array<double, 4> tilts{};
    if (!TakeStamp(&place, &pose.sensed_at) ||
        !TakeNumbers(&place, pose.camera_from_target.translation.data(), 3) ||
        !TakeNumbers(&place, pose.camera_from_target.rotation.coeffs().data(), 4) ||
        !TakeNumbers(&place, pose.covariance.data(), 36) || !TakeNumbers(&place, tilts.data(), 4)) {
      return false;
    }
    pose.target_tilt = {tilts[0], tilts[1]};
    pose.camera_tilt = {tilts[2], tilts[3]};
  }
  bool moved = false;
  bool has_baseline = false;
  TiltBaseline baseline;
  if (!TakeFlag(&place, &moved) || !TakeFlag(&place, &has_baseline)) return false;
  if (has_baseline &&
      (!TakeNumbers(&place, baseline.offset_rad.data(), baseline.offset_rad.size()) ||
       !TakeNumbers(&place, baseline.covariance.data(), baseline.covariance.size()) ||
       !TakeNumbers(&place, baseline.by_centres.data(), baseline.by_centres.size()))) {
    return false;
  }
  if (std::string_view(place) != "\n") return false;
  last_sensed_at_ = has_stamp ? std::optional(stamp) : std::nullopt;
  accepted_ = has_pose ? std::optional(pose) : std::nullopt;
  mounting_moved_ = moved;
  monitor_.Restart(has_baseline ? std::optional(baseline) : std::nullopt);
  return true;
}

}  // namespace tbm
