#include "guidance/app/target_report.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "guidance/app/csv_field.h"
#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/rig/rig_text.h"

namespace tbm {
namespace {

std::vector<Led> LedsOf(const TargetResult& result) {
  std::vector<Led> leds = result.nominal;
  for (std::size_t j = 0; j < leds.size(); ++j) {
    leds[j].p_led_in_target = result.found.led_in_target_m[j];
    leds[j].sigma_m = result.found.led_sigma_m[j];
  }
  return leds;
}

// What became of one placement.
struct PlacementFit {
  std::size_t leds = 0;
  double rms_mm = 0.0;                 // of one coordinate
  double tilt_deg = 0.0;               // of the board against the first placement
  std::optional<double> read_off_deg;  // reading of the inclinometer against R1
};

PlacementFit FitOf(const TargetResult& result, std::size_t i) {
  PlacementFit fit;
  double sum_m2 = 0.0;
  for (const TargetSighting& sighting : result.found.sightings) {
    if (sighting.placement != i) continue;
    ++fit.leds;
    sum_m2 += sighting.off_in_site_m.squaredNorm();
  }
  fit.rms_mm = kMmPerMetre * std::sqrt(sum_m2 / (3.0 * static_cast<double>(fit.leds)));
  const auto up_in_target = [&](std::size_t k) -> Eigen::Vector3d {
    return result.found.site_from_target[k].rotation.conjugate() * Eigen::Vector3d::UnitZ();
  };
  const auto angle_deg = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return RadToDeg(std::atan2(a.cross(b).norm(), a.dot(b)));
  };
  fit.tilt_deg = angle_deg(up_in_target(0), up_in_target(i));
  const auto& felt = result.placements[i].up_in_housing;
  if (felt && result.found.housing_from_target) {
    fit.read_off_deg = angle_deg(*felt, *result.found.housing_from_target * up_in_target(i));
  }
  return fit;
}

std::size_t Readings(const TargetResult& result) {
  return static_cast<std::size_t>(std::count_if(
      result.placements.begin(), result.placements.end(), [](const TargetPlacement& one) {
        return one.up_in_housing.has_value();
      }));
}

// What a rig file is to say of one reading.
double LargestTiltSigma_rad(const TargetResult& result) {
  double largest_rad = 0.0;
  for (const TargetPlacement& one : result.placements) {
    if (one.up_in_housing) largest_rad = std::max(largest_rad, one.tilt_sigma_rad);
  }
  return largest_rad;
}

std::string MountingText(const TargetResult& result) {
  const TargetCalibration& found = result.found;
  if (!found.housing_from_target) {
    return "no R1, the mounting of the board's inclinometer: " +
           MissingForMounting(*found.mounting_missing, Readings(result)) + "\n";
  }
  const Eigen::Vector3d sigma_deg =
      RadToDeg(1.0) * found.mounting_covariance.diagonal().cwiseSqrt();
  return fmt::format(
      "R1, the mounting of the board's inclinometer, from {} readings: sigma {:.4f} / {:.4f} / "
      "{:.4f} degrees about the board's x / y / z; of up on a level board {:.4f}; of one reading "
      "{:.4g}, the largest that tilt.csv, or else --sigma-deg, says\n",
      Readings(result),
      sigma_deg.x(),
      sigma_deg.y(),
      sigma_deg.z(),
      RadToDeg(MountingSigma_rad(found.mounting_covariance, *found.housing_from_target)),
      RadToDeg(LargestTiltSigma_rad(result)));
}

}  // namespace

std::string MissingForMounting(const TiltRotationFailure& failure, std::size_t readings) {
  const std::string sigma =
      std::isfinite(failure.sigma_rad)
          ? fmt::format(" (sigma would be {:.2f} degrees)", RadToDeg(failure.sigma_rad))
          : "";
  switch (failure.fault) {
    case TiltRotationFault::kTooFew:
      return fmt::format(
          "it takes readings at two placements or more, better six, and there {} {}; the board "
          "must "
          "be tilted by ten degrees or more between them",
          readings == 1 ? "is" : "are",
          readings);
    case TiltRotationFault::kNoTilt:
      return "the board stood equally upright in all placements; tilt it by ten degrees or more "
             "between them, forwards and to a side";
    case TiltRotationFault::kOneAxis:
    case TiltRotationFault::kNoYaw:
    case TiltRotationFault::kTooWeak:
      return "tilt the board further between the placements, forwards and to a side, or take more "
             "of them" +
             sigma;
    case TiltRotationFault::kNoRotation:
    case TiltRotationFault::kDoesNotFit:
      return "the readings contradict the points: see that each reading belongs to its placement, "
             "that the total station was levelled, and which way the angles count (--sign)";
  }
  return "";
}

std::string TargetPartYaml(const TargetResult& result) {
  const TargetCalibration& found = result.found;
  const double per_rad = RadToDeg(1.0);
  std::string text = TargetYaml(LedsOf(result));
  if (found.housing_from_target) {
    TiltMount mount;
    mount.tilt_from_body = *found.housing_from_target;
    mount.sign = {result.request.sign[0], result.request.sign[1]};
    mount.sigma_rad = LargestTiltSigma_rad(result);
    mount.mounting_sigma_rad =
        MountingSigma_rad(found.mounting_covariance, *found.housing_from_target);
    text += "inclinometers:\n  target:\n" + TiltMountYaml(mount);
  } else {
    text += "# " + MountingText(result);
  }
  text += "# What these numbers rest on. No part of a rig file.\ncalibrated:\n";
  std::vector<std::string> files;
  for (const std::string& file : result.files) files.push_back(YamlText(file));
  text += fmt::format(
      "  nominal: {}\n  placements: [{}]\n  readings: {}\n  points: {}\n  point_sigma_mm: {}\n"
      "  sigma_factor: {:.4g}\n  chi2: {:.2f}\n  degrees_of_freedom: {}\n",
      YamlText(result.request.nominal),
      fmt::join(files, ", "),
      Readings(result),
      found.sightings.size(),
      result.request.sigma_mm,
      found.sigma_factor,
      found.chi2,
      found.dof);
  if (found.housing_from_target) {
    std::vector<std::string> numbers;
    for (int i = 0; i < 9; ++i) {
      numbers.push_back(
          fmt::format("{:.6e}", per_rad * per_rad * found.mounting_covariance(i / 3, i % 3)));
    }
    text += fmt::format(
        "  # of the turn that is still missing, about the target's axes\n  covariance_deg2: [{}]\n"
        "  mounting_factor: {:.4g}\n",
        fmt::join(numbers, ", "),
        found.mounting_factor);
  }
  return text;
}

std::string TargetSummary(const TargetResult& result) {
  const TargetCalibration& found = result.found;
  std::string text = fmt::format("{} LEDs, {} placement{}, {} points",
                                 result.nominal.size(),
                                 result.files.size(),
                                 result.files.size() == 1 ? "" : "s",
                                 found.sightings.size());
  text += found.dof > 0 ? fmt::format("; points fit with {:.3f} mm, {} was declared\n\n",
                                      result.request.sigma_mm * std::sqrt(found.chi2 / found.dof),
                                      result.request.sigma_mm)
                        : std::string("; nothing controls them\n\n");
  text += fmt::format("{:>8} {:>10} {:>10} {:>10} {:>8}   {:>24}\n",
                      "LED",
                      "x mm",
                      "y mm",
                      "z mm",
                      "sigma",
                      "less the drawing x y z");
  for (std::size_t j = 0; j < result.nominal.size(); ++j) {
    const Eigen::Vector3d place_mm = kMmPerMetre * found.led_in_target_m[j];
    const Eigen::Vector3d off_mm = place_mm - kMmPerMetre * result.nominal[j].p_led_in_target;
    text +=
        fmt::format("{:>8} {:>10.3f} {:>10.3f} {:>10.3f} {:>8.3f}   {:>7.2f} {:>7.2f} {:>7.2f}\n",
                    result.nominal[j].id,
                    place_mm.x(),
                    place_mm.y(),
                    place_mm.z(),
                    kMmPerMetre * found.led_sigma_m[j],
                    off_mm.x(),
                    off_mm.y(),
                    off_mm.z());
  }
  text += "\n  LEDs   fit mm   tilted deg   reading off deg   placement\n";
  for (std::size_t i = 0; i < result.files.size(); ++i) {
    const PlacementFit fit = FitOf(result, i);
    text += fmt::format("{:>6} {:>8.3f} {:>12.2f} {:>17}   {}\n",
                        fit.leds,
                        fit.rms_mm,
                        fit.tilt_deg,
                        fit.read_off_deg ? fmt::format("{:.4f}", *fit.read_off_deg) : "-",
                        result.files[i]);
  }
  return text + "\n" + MountingText(result);
}

std::string TargetCsv(const TargetResult& result) {
  std::string text = "placement,led,off_x_mm,off_y_mm,off_z_mm,from_others_mm,misfit,controlled\n";
  for (const TargetSighting& sighting : result.found.sightings) {
    const Eigen::Vector3d off_mm = kMmPerMetre * sighting.off_in_site_m;
    text += fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.3f},{}\n",
                        CsvField(result.files[sighting.placement]),
                        result.nominal[sighting.led].id,
                        off_mm.x(),
                        off_mm.y(),
                        off_mm.z(),
                        kMmPerMetre * sighting.from_others_m,
                        sighting.misfit,
                        sighting.controlled);
  }
  return text;
}

std::string TargetJson(const TargetResult& result) {
  const TargetCalibration& found = result.found;
  nlohmann::ordered_json json;
  json["nominal"] = result.request.nominal;
  json["point_sigma_mm"] = result.request.sigma_mm;
  json["sigma_factor"] = found.sigma_factor;
  json["chi2"] = found.chi2;
  json["degrees_of_freedom"] = found.dof;
  for (std::size_t j = 0; j < result.nominal.size(); ++j) {
    const Eigen::Vector3d place_mm = kMmPerMetre * found.led_in_target_m[j];
    const Eigen::Vector3d off_mm = place_mm - kMmPerMetre * result.nominal[j].p_led_in_target;
    json["leds"].push_back({{"id", result.nominal[j].id},
                            {"xyz_mm", {place_mm.x(), place_mm.y(), place_mm.z()}},
                            {"sigma_mm", kMmPerMetre * found.led_sigma_m[j]},
                            {"less_nominal_mm", {off_mm.x(), off_mm.y(), off_mm.z()}}});
  }
  for (std::size_t i = 0; i < result.files.size(); ++i) {
    const PlacementFit fit = FitOf(result, i);
    nlohmann::ordered_json one = {{"file", result.files[i]},
                                  {"leds", fit.leds},
                                  {"rms_mm", fit.rms_mm},
                                  {"tilt_deg", fit.tilt_deg},
                                  {"reading_off_deg", nullptr}};
    if (fit.read_off_deg) one["reading_off_deg"] = *fit.read_off_deg;
    json["placements"].push_back(one);
  }
  nlohmann::ordered_json mounting = nullptr;
  if (found.housing_from_target) {
    for (int i = 0; i < 9; ++i) {
      mounting["rotation"].push_back((*found.housing_from_target)(i / 3, i % 3));
      mounting["covariance_deg2"].push_back(RadToDeg(1.0) * RadToDeg(1.0) *
                                            found.mounting_covariance(i / 3, i % 3));
    }
    mounting["sigma_factor"] = found.mounting_factor;
    mounting["mounting_sigma_deg"] =
        RadToDeg(MountingSigma_rad(found.mounting_covariance, *found.housing_from_target));
  }
  json["mounting"] = mounting;
  if (found.mounting_missing) {
    json["mounting_missing"] = MissingForMounting(*found.mounting_missing, Readings(result));
  }
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

}  // namespace tbm
