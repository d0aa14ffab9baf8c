#include "devices/app/fault_options.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include "pose/base/angle.h"

namespace tbm {
namespace {

std::optional<double> Number(std::string_view text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

struct Parts {
  std::vector<std::string_view> fields;  // between commas
  sim::Window window;
};

std::optional<Parts> Split(std::string_view text) {
  Parts parts;
  const std::size_t at = text.find('@');
  if (at != std::string_view::npos) {
    const std::string_view window = text.substr(at + 1);
    const std::size_t dash = window.find('-');
    if (dash == std::string_view::npos) return std::nullopt;
    const auto from = Number(window.substr(0, dash));
    const auto to = Number(window.substr(dash + 1));
    if (!from || !to || *to <= *from) return std::nullopt;
    parts.window = {*from, *to};
    text = text.substr(0, at);
  }
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    parts.fields.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

// The fields from `first` on as numbers, when there are exactly `count` of them.
std::optional<std::vector<double>> Numbers(const Parts& parts,
                                           std::size_t first,
                                           std::size_t count) {
  if (parts.fields.size() != first + count) return std::nullopt;
  std::vector<double> numbers;
  for (std::size_t i = first; i < parts.fields.size(); ++i) {
    const auto number = Number(parts.fields[i]);
    if (!number) return std::nullopt;
    numbers.push_back(*number);
  }
  return numbers;
}

Failure<std::string> Wrong(const char* option, const std::string& text, const char* wanted) {
  return Failure{fmt::format("--{} {}: wanted {}", option, text, wanted)};
}

}  // namespace

Result<sim::HiddenLed, std::string> ParseHiddenLed(const std::string& text, const Rig& rig) {
  const auto parts = Split(text);
  if (parts && parts->fields.size() == 1) {
    for (std::size_t led = 0; led < rig.leds.size(); ++led) {
      if (rig.leds[led].id == parts->fields[0]) return sim::HiddenLed{led, parts->window};
    }
  }
  return Wrong("hide-led", text, "an LED of the rig, such as P3 or P3@10-20");
}

Result<sim::Lamp, std::string> ParseLamp(const std::string& text) {
  const auto parts = Split(text);
  const auto numbers = parts ? Numbers(*parts, 0, 4) : std::nullopt;
  if (!numbers || (*numbers)[2] <= 0.0) {
    return Wrong("lamp", text, "U,V,SPREAD,PEAK[@FROM-TO], such as 640,200,15,600@5-10");
  }
  const std::vector<double>& n = *numbers;
  return sim::Lamp{{n[0], n[1]}, {n[2], n[2]}, n[3], parts->window};
}

Result<sim::Reflection, std::string> ParseReflection(const std::string& text) {
  const char* const wanted = "MIRROR_U,DU,DV,STRENGTH[@FROM-TO], such as 640,0,30,0.4 or -,8,3,0.3";
  const auto parts = Split(text);
  const auto numbers = parts ? Numbers(*parts, 1, 3) : std::nullopt;
  if (!numbers) return Wrong("reflection", text, wanted);
  const std::vector<double>& n = *numbers;
  sim::Reflection reflection{0.0, {n[0], n[1]}, false, n[2], parts->window};
  if (parts->fields[0] == "-") return reflection;
  const auto mirror_u_px = Number(parts->fields[0]);
  if (!mirror_u_px) return Wrong("reflection", text, wanted);
  reflection.mirror_u_px = *mirror_u_px;
  reflection.is_mirrored = true;
  return reflection;
}

Result<sim::TiltFault, std::string> ParseTiltFault(const std::string& text) {
  const auto parts = Split(text);
  const auto numbers = parts ? Numbers(*parts, 1, 2) : std::nullopt;
  if (!numbers || (parts->fields[0] != "target" && parts->fields[0] != "camera")) {
    return Wrong(
        "tilt-fault", text, "target|camera,BETA_DEG,GAMMA_DEG[@FROM-TO], such as target,4,0@20-30");
  }
  const std::vector<double>& n = *numbers;
  return sim::TiltFault{
      parts->fields[0] == "target" ? sim::TiltSensor::kTarget : sim::TiltSensor::kCamera,
      {DegToRad(n[0]), DegToRad(n[1])},
      parts->window};
}

}  // namespace tbm
