#include "guidance/app/line_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/rail_run.h"
#include "guidance/app/rail_start_words.h"
#include "guidance/app/table_and_report.h"
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
    // Rounded to no more than the last digit: nothing is known without an error.
    const Eigen::Vector3d sigma_mm = (1e3 * point.sigma_world_m).cwiseMax(1e-3);
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

Result<RailLine, RailStartFailure> Solve(const LineRequest& request, const RailRun& run) {
  if (request.method == "inertial") return SolveInertialLine(run.setup, run.recording);
  return SolveRailLine(run.setup,
                       run.recording,
                       request.method == "filter" ? RailMethod::kFilter : RailMethod::kSmoothed);
}

}  // namespace

Result<std::string, std::vector<std::string>> WriteLine(
    const LineRequest& request, const std::function<void(const std::string&)>& warn) {
  const auto why = [](std::string fault) {
    return Failure{std::vector<std::string>{std::move(fault)}};
  };
  const TableAndReport files(request.out, request.force);
  if (const auto obstacle = files.Obstacle()) return why(*obstacle);
  const auto run = ReadRailRun(request.run);
  if (!run) {
    std::vector<std::string> faults;
    for (const FileFault& fault : run.error()) faults.push_back(fault.Text());
    return Failure{std::move(faults)};
  }
  for (const std::string& warning : run->warnings) warn(warning);
  for (const std::string& advice : run->advice) warn(advice);
  const auto line = Solve(request, *run);
  if (!line) return why(request.run + "/" + Explain(line.error(), run->setup));
  // A target's name may be no UTF-8.
  const std::string report =
      Report(request, *run, *line).dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (const auto fault = files.Write(Table(*line), report)) return why(*fault);
  return files.has_report() ? Summary(*line, *run) : "";
}

ExitCode RunLine(const LineRequest& request, const Console& console) {
  const auto summary = WriteLine(
      request, [&](const std::string& warning) { Complain(console, "warning: " + warning); });
  if (!summary) {
    for (const std::string& fault : summary.error()) Complain(console, fault);
    return ExitCode::kBadInput;
  }
  console.out << *summary;
  return ExitCode::kDone;
}

}  // namespace tbm
