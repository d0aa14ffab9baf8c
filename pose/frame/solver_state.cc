#include <array>
#include <cstdio>
#include <cstdlib>

#include "pose/frame/frame_solver.h"

namespace tbm {
namespace {

constexpr std::string_view kHeading = "tbm_solver_state 1";
constexpr std::size_t kNumbers = 3 + 4 + 36 + 4;

// "%a" prints a double in hexadecimal: every bit comes back.
void Append(std::string& text, double value) {
  std::array<char, 40> buffer{};
  std::snprintf(buffer.data(), buffer.size(), " %a", value);
  text += buffer.data();
}

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

}  // namespace

std::string FrameSolver::SaveState() const {
  std::string text(kHeading);
  text += " " + std::to_string(last_sensed_at_ ? 1 : 0) + " " +
          std::to_string(last_sensed_at_ ? last_sensed_at_->ns : 0);
  text += " " + std::to_string(accepted_ ? 1 : 0);
  if (accepted_) {
    text += " " + std::to_string(accepted_->sensed_at.ns);
    const Rigid3& pose = accepted_->camera_from_target;
    for (int i = 0; i < 3; ++i) Append(text, pose.translation[i]);
    for (int i = 0; i < 4; ++i) Append(text, pose.rotation.coeffs()[i]);
    for (int i = 0; i < 36; ++i) Append(text, accepted_->covariance.data()[i]);
    for (const Inclination* tilt : {&accepted_->target_tilt, &accepted_->camera_tilt}) {
      Append(text, tilt->beta_rad);
      Append(text, tilt->gamma_rad);
    }
  }
  text += "\n";
  return text;
}

bool FrameSolver::RestoreState(const std::string& state) {
  if (state.compare(0, kHeading.size(), kHeading) != 0) return false;
  const char* place = state.c_str() + kHeading.size();
  const auto take_flag = [&place](Timestamp* flag) {
    return TakeStamp(&place, flag) && (flag->ns == 0 || flag->ns == 1);
  };
  Timestamp has_stamp;
  Timestamp stamp;
  Timestamp has_pose;
  if (!take_flag(&has_stamp) || !TakeStamp(&place, &stamp) || !take_flag(&has_pose)) return false;

  std::optional<AcceptedPose> accepted;
  if (has_pose.ns == 1) {
    AcceptedPose pose;
    std::array<double, kNumbers> numbers{};
    if (!TakeStamp(&place, &pose.sensed_at)) return false;
    for (double& number : numbers) {
      if (!Take(&place, &number, [](const char* text, char** end) {
            return std::strtod(text, end);
          })) {
        return false;
      }
    }
    const double* next = numbers.data();
    for (int i = 0; i < 3; ++i) pose.camera_from_target.translation[i] = *next++;
    for (int i = 0; i < 4; ++i) pose.camera_from_target.rotation.coeffs()[i] = *next++;
    for (int i = 0; i < 36; ++i) pose.covariance.data()[i] = *next++;
    pose.target_tilt = {next[0], next[1]};
    pose.camera_tilt = {next[2], next[3]};
    accepted = pose;
  }
  if (std::string_view(place) != "\n") return false;
  last_sensed_at_ = has_stamp.ns == 1 ? std::optional(stamp) : std::nullopt;
  accepted_ = accepted;
  return true;
}

}  // namespace tbm
