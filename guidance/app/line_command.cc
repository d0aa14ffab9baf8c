#include "guidance/app/line_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/output_file.h"
#include "guidance/app/rail_run.h"
#include "guidance/rail/inertial_line.h"
#include "guidance/rail/rail_line.h"

namespace tbm {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kHeader =
    "stamp_ns,distance_m,x_m,y_m,z_m,qw,qx,qy,qz,sigma_x_mm,sigma_y_mm,sigma_z_mm,status\n";

std::string Table(const RailLine& line) {
  std::string text(kHeader);
  for (const RailPoint& point : line.points) {
    const Eigen::Vector3d& p = point.position_world_m;
    const Eigen::Quaterniond& q = point.world_from_imu;
    const Eigen::Vector3d sigma_mm = 1e3 * point.sigma_world_m;
    fmt::format_to(std::back_inserter(text),
                   "{},{:.6f},{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f},{:.9f},{:.3f},{:.3f},"
                   "{:.3f},{}\n",
                   point.at.ns,
                   point.distance_m,
                   p.x(),
                   p.y(),
                   p.z(),
                   q.w(),
                   q.x(),
                   q.y(),
                   q.z(),
                   sigma_mm.x(),
                   sigma_mm.y(),
                   sigma_mm.z(),
                   Word(point.status));
  }
  return text;
}

// How far the line lies from truth, where truth is known.
struct Deviation {
  std::size_t rows = 0;
  Eigen::Vector3d largest_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d rms_mm = Eigen::Vector3d::Zero();
  double error_over_sigma = 0.0;
};

Deviation DeviationOf(const RailLine& line, const std::vector<RailTruthRow>& truth) {
  Deviation deviation;
  double squared = 0.0;
  auto known = truth.begin();
  for (const RailPoint& point : line.points) {
    while (known != truth.end() && known->at < point.at) ++known;
    if (known == truth.end()) break;
    if (known->at != point.at) continue;
    const Eigen::Vector3d off_mm = 1e3 * (point.position_world_m - known->position_world_m);
    deviation.largest_mm = deviation.largest_mm.cwiseMax(off_mm.cwiseAbs());
    deviation.rms_mm += off_mm.cwiseAbs2();
    squared += off_mm.cwiseQuotient(1e3 * point.sigma_world_m).squaredNorm() / 3.0;
    ++deviation.rows;
  }
  if (deviation.rows == 0) return deviation;
  const double count = static_cast<double>(deviation.rows);
  deviation.rms_mm = (deviation.rms_mm / count).cwiseSqrt();
  deviation.error_over_sigma = std::sqrt(squared / count);
  return deviation;
}

Json Three(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json Report(const LineRequest& request, const RailRun& run, const RailLine& line) {
  Json report;
  report["method"] = request.method;
  report["samples"] = line.points.size();
  report["distance_m"] = line.points.empty() ? 0.0 : line.points.back().distance_m;
  Json estimates = Json::array();
  Json unobserved = Json::array();
  for (const RailEstimate& estimate : line.estimates) {
    estimates.push_back({{"what", estimate.what},
                         {"value", estimate.value},
                         {"sigma", estimate.sigma},
                         {"sigma_before", estimate.sigma_before}});
    if (estimate.missing_motion.empty()) continue;
    unobserved.push_back({{"what", estimate.what}, {"missing", estimate.missing_motion}});
  }
  report["estimates"] = std::move(estimates);
  Json consistency = Json::object();
  for (int i = 0; i < kFusionUpdates; ++i) {
    const RailConsistency& kind = line.consistency[static_cast<std::size_t>(i)];
    if (kind.given == 0) continue;
    consistency[std::string(Word(static_cast<FusionUpdate>(i)))] = {
        {"given", kind.given},
        {"accepted", kind.accepted},
        {"nis_per_dof", kind.dof > 0.0 ? Json(kind.nis / kind.dof) : Json(nullptr)}};
  }
  report["consistency"] = std::move(consistency);
  Json rejected = Json::array();
  for (const RailRejection& one : line.rejections) {
    rejected.push_back({{"stamp_ns", one.at.ns}, {"what", one.what}, {"why", one.why_not}});
  }
  report["rejected"] = std::move(rejected);
  report["not_observed"] = std::move(unobserved);
  report["target_survey"] = {{"modes", line.target_modes},
                             {"left_out_mm", 1e3 * line.target_modes_left_out_m}};
  const Deviation deviation = DeviationOf(line, run.truth);
  if (deviation.rows > 0) {
    report["truth"] = {{"rows", deviation.rows},
                       {"largest_mm", Three(deviation.largest_mm)},
                       {"rms_mm", Three(deviation.rms_mm)},
                       {"error_over_sigma", deviation.error_over_sigma}};
  }
  report["warnings"] = run.warnings;
  return report;
}

// What one wants to know before one opens the files.
std::string Summary(const RailLine& line, const RailRun& run) {
  Eigen::Vector3d worst_mm = Eigen::Vector3d::Zero();
  std::map<std::string_view, std::size_t> statuses;
  for (const RailPoint& point : line.points) {
    worst_mm = worst_mm.cwiseMax(1e3 * point.sigma_world_m);
    ++statuses[Word(point.status)];
  }
  std::string text =
      fmt::format("{} samples, {:.3f} m; sigma at most {:.2f} / {:.2f} / {:.2f} mm (x / y / z)\n",
                  line.points.size(),
                  line.points.empty() ? 0.0 : line.points.back().distance_m,
                  worst_mm.x(),
                  worst_mm.y(),
                  worst_mm.z());
  for (const auto& [status, count] : statuses) text += fmt::format("  {:6} {}\n", count, status);
  std::map<std::string, std::size_t> rejected;
  for (const RailRejection& one : line.rejections) ++rejected[one.why_not];
  for (const auto& [why, count] : rejected) {
    text += fmt::format("  {:6} measurements not taken: {}\n", count, why);
  }
  for (const RailEstimate& estimate : line.estimates) {
    if (estimate.missing_motion.empty()) continue;
    text +=
        fmt::format("  not observed: {}; it takes {}\n", estimate.what, estimate.missing_motion);
  }
  const Deviation deviation = DeviationOf(line, run.truth);
  if (deviation.rows > 0) {
    text += fmt::format(
        "  from truth.csv at most {:.2f} / {:.2f} / {:.2f} mm, error over sigma {:.2f}\n",
        deviation.largest_mm.x(),
        deviation.largest_mm.y(),
        deviation.largest_mm.z(),
        deviation.error_over_sigma);
  }
  return text;
}

constexpr std::array<std::string_view, 6> kImuAxes = {
    "gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s", "accel_x_m_s2", "accel_y_m_s2", "accel_z_m_s2"};

std::string Explain(const RailStartFailure& failure, const RailRun& run) {
  switch (failure.fault) {
    case RailStartFault::kNoImu:
      return "imu.csv: there is less than a second of samples";
    case RailStartFault::kNoRest:
      return "rail.yaml: start.at_rest_s: the trolley must rest for at least 2 s at first";
    case RailStartFault::kMovesAtStart:
      return fmt::format(
          "imu.csv: the trolley moves {:.1f} s after its first sample, and rail.yaml says "
          "start.at_rest_s: {}; give the time it really rested",
          failure.at_s,
          run.setup.start.at_rest_s);
    case RailStartFault::kWrongRateUnit:
      return fmt::format(
          "imu.csv: the gyros' noise at rest is {:.0f} times what imu.angle_random_walk_deg_sqrt_h "
          "says: are these degrees per second where radians per second belong?",
          failure.times);
    case RailStartFault::kWrongForce:
      return fmt::format(
          "imu.csv: at rest the accelerometers show {:.3f} times gravity: m/s2 belong there, not g "
          "or mg",
          failure.times);
    case RailStartFault::kBiasTooLarge:
      return fmt::format(
          "imu.csv: {} shows at rest {:.0f} times what imu.gyro_bias_deg_h and the turning of the "
          "Earth allow",
          kImuAxes[static_cast<std::size_t>(failure.axis)],
          failure.times);
    case RailStartFault::kFrozen:
      return fmt::format("imu.csv: {} shows one and the same number",
                         kImuAxes[static_cast<std::size_t>(failure.axis)]);
    case RailStartFault::kNoHeading:
      return "rail.yaml: the heading is not known and no target is seen: give start.heading_deg, "
             "sigma_heading_deg and heading_known: true";
    case RailStartFault::kNoTargetFits:
      return fmt::format(
          "centres.csv: whatever the heading, the targets lie {:.0f} px from where "
          "start.position_m and targets.csv put them: names exchanged, another place, or another "
          "camera",
          failure.off_px);
  }
  return "";
}

Result<RailLine, RailStartFailure> Solve(const LineRequest& request, const RailRun& run) {
  if (request.method == "inertial") return SolveInertialLine(run.setup, run.recording);
  return SolveRailLine(run.setup,
                       run.recording,
                       request.method == "filter" ? RailMethod::kFilter : RailMethod::kSmoothed);
}

std::string ReportName(const std::string& out) {
  const std::size_t dot = out.rfind('.');
  const std::size_t slash = out.rfind('/');
  const bool has_suffix = dot != std::string::npos && (slash == std::string::npos || dot > slash);
  return (has_suffix ? out.substr(0, dot) : out) + ".json";
}

}  // namespace

ExitCode RunLine(const LineRequest& request, const Console& console) {
  const bool has_report = request.out != "-";
  const OutputFile table(request.out, request.force);
  const OutputFile report(has_report ? ReportName(request.out) : "", request.force);
  for (const OutputFile* file : {&table, has_report ? &report : &table}) {
    if (const auto obstacle = file->Obstacle()) {
      Complain(console, *obstacle);
      return ExitCode::kBadInput;
    }
  }
  const auto run = ReadRailRun(request.run);
  if (!run) {
    Complain(console, run.error());
    return ExitCode::kBadInput;
  }
  for (const std::string& warning : run->warnings) Complain(console, "warning: " + warning);
  const auto line = Solve(request, *run);
  if (!line) {
    Complain(console, request.run + "/" + Explain(line.error(), *run));
    return ExitCode::kBadInput;
  }
  auto fault = table.Write(Table(*line));
  if (!fault && has_report) fault = report.Write(Report(request, *run, *line).dump(2) + "\n");
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (has_report) console.out << Summary(*line, *run);
  return ExitCode::kDone;
}

}  // namespace tbm
