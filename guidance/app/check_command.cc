#include "guidance/app/check_command.h"

#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/accuracy.h"
#include "guidance/app/check_report.h"

namespace tbm {
namespace {

struct Figures {
  Pairs pairs;
  std::optional<Alignment> alignment;

  Spreads spreads() const {
    std::vector<Eigen::Vector3d> differences_mm;
    for (const Observation& observation : pairs.observations) {
      differences_mm.push_back(observation.difference_mm());
    }
    return Spreads(differences_mm);
  }
};

Figures FiguresOf(Pairs pairs, bool align_rigid) {
  Figures figures;
  figures.pairs = std::move(pairs);
  if (align_rigid) figures.alignment = AlignRigid(figures.pairs);
  return figures;
}

std::string AlignmentText(const Figures& figures) {
  const std::size_t data = 3 * figures.pairs.observations.size();
  if (!figures.alignment) return "align     none: both files are taken to be in one frame";
  return fmt::format("align     rigid: took {} degrees of freedom of {}",
                     figures.alignment->degrees_of_freedom,
                     data);
}

std::string PairingText(const Figures& figures) {
  std::array<std::size_t, 4> counts{};
  for (const Observation& observation : figures.pairs.observations) {
    ++counts[static_cast<std::size_t>(observation.pairing)];
  }
  std::string text = "pairs    ";
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0)
      text += fmt::format(" {} {}", counts[i], PairingWord(static_cast<Pairing>(i)));
  }
  return text +
         fmt::format("; left out: {} without a pose (status none), {} without a partner in time",
                     figures.pairs.without_pose,
                     figures.pairs.without_partner);
}

std::string PrintedText(const Figures& figures, const CheckRequest& request) {
  std::string text =
      fmt::format("point     {}: {} minus {}, mm\n", request.point, request.poses, request.log);
  text += PairingText(figures) + "\n" + AlignmentText(figures) + "\n\n";
  text += fmt::format(
      "{:>4} {:>20} {:>9} {:>9} {:>9} {:>9}\n", "no", "stamp_ns", "dx", "dy", "dz", "distance");
  const auto& observations = figures.pairs.observations;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Eigen::Vector3d d = observations[i].difference_mm();
    text += fmt::format("{:>4} {:>20} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f}\n",
                        i + 1,
                        observations[i].at ? std::to_string(observations[i].at->ns) : "-",
                        d.x(),
                        d.y(),
                        d.z(),
                        d.norm());
  }
  text += figures.spreads().Text();
  return text;
}

std::string CsvText(const Figures& figures) {
  std::string text =
      "stamp_ns,pairing,pose_x_mm,pose_y_mm,pose_z_mm,log_x_mm,log_y_mm,log_z_mm,dx_mm,dy_mm,dz_mm,"
      "distance_mm\n";
  for (const Observation& o : figures.pairs.observations) {
    const Eigen::Vector3d d = o.difference_mm();
    text +=
        fmt::format("{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n",
                    o.at ? std::to_string(o.at->ns) : "",
                    PairingWord(o.pairing),
                    o.posed_mm.x(),
                    o.posed_mm.y(),
                    o.posed_mm.z(),
                    o.surveyed_mm.x(),
                    o.surveyed_mm.y(),
                    o.surveyed_mm.z(),
                    d.x(),
                    d.y(),
                    d.z(),
                    d.norm());
  }
  return text;
}

std::string JsonText(const Figures& figures, const CheckRequest& request) {
  nlohmann::ordered_json json;
  json["poses"] = request.poses;
  json["log"] = request.log;
  json["point"] = request.point;
  json["observations"] = figures.pairs.observations.size();
  json["without_pose"] = figures.pairs.without_pose;
  json["without_partner"] = figures.pairs.without_partner;
  json["align"] = figures.alignment ? "rigid" : "none";
  json["align_degrees_of_freedom"] = figures.alignment ? figures.alignment->degrees_of_freedom : 0;
  if (figures.alignment) {
    const Eigen::Quaterniond& q = figures.alignment->posed_from_surveyed.rotation;
    const Eigen::Vector3d& t = figures.alignment->posed_from_surveyed.translation;
    json["camera_from_log"] = {{"qw", q.w()},
                               {"qx", q.x()},
                               {"qy", q.y()},
                               {"qz", q.z()},
                               {"tx_mm", t.x()},
                               {"ty_mm", t.y()},
                               {"tz_mm", t.z()}};
  }
  figures.spreads().AddTo(&json);
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string PlotScript(const Figures& figures, const CheckRequest& request) {
  std::string script = "$data << EOD\n";
  const auto& observations = figures.pairs.observations;
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Eigen::Vector3d d = observations[i].difference_mm();
    script += fmt::format("{} {:.5f} {:.5f} {:.5f} {:.5f}\n", i + 1, d.x(), d.y(), d.z(), d.norm());
  }
  script += "EOD\n";
  script += PanelsScript(figures.spreads(),
                         observations.size(),
                         4,
                         fmt::format("tbm check: {}, {} observations, {} [mm]",
                                     request.point,
                                     observations.size(),
                                     figures.alignment ? "aligned" : "not aligned"));
  return script + std::string(kPanelsEnd);
}

Result<Pairs, std::string> ReadPairs(const CheckRequest& request, const Console& console) {
  auto poses_text = ReadTextFile(request.poses);
  if (!poses_text) return Failure{poses_text.error().Text()};
  auto log_text = ReadTextFile(request.log);
  if (!log_text) return Failure{log_text.error().Text()};
  const auto poses = ReadPosedPoint(std::move(poses_text).value(), request.poses, request.point);
  if (!poses) return Failure{poses.error().Text()};
  const std::string& log_point = request.log_point.empty() ? request.point : request.log_point;
  const auto log = ReadSurveyLog(std::move(log_text).value(), request.log, log_point);
  if (!log) {
    const bool is_name = log.error().line == 0 && request.log_point.empty();
    return Failure{log.error().Text() +
                   (is_name ? "; --log-point gives the name it has in the log" : "")};
  }
  if (log->other_points > 0) {
    Complain(
        console,
        fmt::format("{}: {} rows of other points are passed over", request.log, log->other_points));
  }
  const Duration tolerance(static_cast<std::int64_t>(std::llround(request.tolerance_ms * 1e6)));
  auto pairs = PairUp(*poses, log->points, tolerance);
  if (pairs && pairs->observations.empty()) {
    return Failure{
        fmt::format("no survey row has a pose within {} ms of it ({} without a pose, {} without "
                    "a partner in time); do both clocks run on UTC?",
                    request.tolerance_ms,
                    pairs->without_pose,
                    pairs->without_partner)};
  }
  return pairs;
}

}  // namespace

ExitCode RunCheck(const CheckRequest& request, const Console& console) {
  if (request.point.empty()) {
    Complain(console, "--point: which point of rig.yaml, such as shield_head, is to be compared?");
    return ExitCode::kBadInput;
  }
  if (const auto fault = ReportObstacle(request)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  auto pairs = ReadPairs(request, console);
  if (!pairs) {
    Complain(console, pairs.error());
    return ExitCode::kBadInput;
  }
  const Figures figures = FiguresOf(std::move(pairs).value(), request.align_rigid);
  console.out << PrintedText(figures, request);
  if (request.report.empty()) return ExitCode::kDone;
  return WriteReport({CsvText(figures), JsonText(figures, request), PlotScript(figures, request)},
                     request,
                     console);
}

}  // namespace tbm
