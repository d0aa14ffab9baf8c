#include "guidance/app/chain_report.h"

#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace tbm {
namespace {

constexpr double kMmPerM = 1e3;

double OverSigma(const ChainObservation& one) { return one.difference_m().norm() / one.sigma_m; }

double InsidePercent(const ChainFigures& figures) {
  return 100.0 * static_cast<double>(figures.inside_95) /
         static_cast<double>(figures.pairs.observations.size());
}

std::string ClockAhead(const ClockEstimate& clock) {
  return fmt::format("the log's clock is {:.2f} s {} guidance's, sigma {:.2f} s",
                     std::abs(clock.ahead_s),
                     clock.ahead_s < 0.0 ? "behind" : "ahead of",
                     clock.sigma_s);
}

}  // namespace

ChainFigures FiguresOf(ChainPairs pairs) {
  ChainFigures figures;
  figures.pairs = std::move(pairs);
  for (const ChainObservation& one : figures.pairs.observations) {
    if (one.IsInside95()) ++figures.inside_95;
    figures.mean_standardised_2 +=
        one.standardised_2 / static_cast<double>(figures.pairs.observations.size());
  }
  return figures;
}

Spreads ChainFigures::spreads() const {
  std::vector<Eigen::Vector3d> differences_mm;
  for (const ChainObservation& one : pairs.observations) {
    differences_mm.push_back(kMmPerM * one.difference_m());
  }
  return Spreads(differences_mm);
}

std::string ClockText(const ClockFinding& clock) {
  if (!clock.estimate) return fmt::format("cannot be told: {}; taken as it is", clock.why_not);
  const ClockEstimate& estimate = *clock.estimate;
  return ClockAhead(estimate) + (estimate.is_significant ? "" : ": not significant") +
         (clock.is_applied ? "; taken out, which took 1 degree of freedom" : "; taken as it is");
}

std::string ChainText(const ChainFigures& figures, const CheckRequest& request) {
  const auto& observations = figures.pairs.observations;
  std::string text = fmt::format("point     {}: {} minus {}, mm, x east, y north, z up\n",
                                 request.point.empty() ? "all" : request.point,
                                 request.poses,
                                 request.log);
  text += fmt::format(
      "pairs     {} interpolated; left out: {} while guidance said that it knows nothing, {} "
      "without samples around them\n",
      observations.size(),
      figures.pairs.without_pose,
      figures.pairs.without_partner);
  text += "clock     " + ClockText(figures.clock) + "\n\n";
  text += fmt::format("{:>4} {:>20} {:>16} {:>9} {:>9} {:>9} {:>9} {:>9} {:>6}\n",
                      "no",
                      "stamp_ns",
                      "point",
                      "dx",
                      "dy",
                      "dz",
                      "distance",
                      "/ sigma",
                      "95 %");
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const ChainObservation& one = observations[i];
    const Eigen::Vector3d d = kMmPerM * one.difference_m();
    text += fmt::format("{:>4} {:>20} {:>16} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.3f} {:>9.2f} {:>6}\n",
                        i + 1,
                        one.at.ns,
                        one.point,
                        d.x(),
                        d.y(),
                        d.z(),
                        d.norm(),
                        OverSigma(one),
                        one.IsInside95() ? "in" : "out");
  }
  text += figures.spreads().Text();
  return text + fmt::format(
                    "\ninside the published 95 % ellipsoid: {} of {} ({:.1f} %); squared "
                    "distance in sigmas {:.2f} on average, 3 is right\n",
                    figures.inside_95,
                    observations.size(),
                    InsidePercent(figures),
                    figures.mean_standardised_2);
}

std::string ChainCsv(const ChainFigures& figures) {
  std::string text =
      "stamp_ns,pairing,pose_x_mm,pose_y_mm,pose_z_mm,log_x_mm,log_y_mm,log_z_mm,dx_mm,dy_mm,dz_mm,"
      "distance_mm,point,sigma_mm,distance_over_sigma,standardised_squared,inside_95\n";
  for (const ChainObservation& one : figures.pairs.observations) {
    const Eigen::Vector3d p = kMmPerM * one.published_m;
    const Eigen::Vector3d q = kMmPerM * one.surveyed_m;
    const Eigen::Vector3d d = kMmPerM * one.difference_m();
    text += fmt::format("{},interpolated,{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},",
                        one.at.ns,
                        p.x(),
                        p.y(),
                        p.z(),
                        q.x(),
                        q.y(),
                        q.z());
    text += fmt::format("{:.4f},{:.4f},{:.4f},{:.4f},{},{:.4f},{:.4f},{:.4f},{}\n",
                        d.x(),
                        d.y(),
                        d.z(),
                        d.norm(),
                        one.point,
                        kMmPerM * one.sigma_m,
                        OverSigma(one),
                        one.standardised_2,
                        one.IsInside95() ? 1 : 0);
  }
  return text;
}

std::string ChainJson(const ChainFigures& figures, const CheckRequest& request) {
  nlohmann::ordered_json json;
  json["poses"] = request.poses;
  json["log"] = request.log;
  json["point"] = request.point.empty() ? "all" : request.point;
  json["observations"] = figures.pairs.observations.size();
  json["without_pose"] = figures.pairs.without_pose;
  json["without_partner"] = figures.pairs.without_partner;
  json["other_points"] = figures.other_points;
  json["align"] = "none";
  json["align_degrees_of_freedom"] = 0;
  nlohmann::ordered_json clock;
  clock["can_be_told"] = figures.clock.estimate.has_value();
  if (figures.clock.estimate) {
    clock["log_ahead_s"] = figures.clock.estimate->ahead_s;
    clock["sigma_s"] = figures.clock.estimate->sigma_s;
    clock["significant"] = figures.clock.estimate->is_significant;
  }
  clock["applied"] = figures.clock.is_applied;
  clock["text"] = ClockText(figures.clock);
  json["clock"] = clock;
  figures.spreads().AddTo(&json);
  json["inside_95"] = figures.inside_95;
  json["inside_95_percent"] = InsidePercent(figures);
  json["mean_standardised_squared"] = figures.mean_standardised_2;
  return json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

std::string ChainPlot(const ChainFigures& figures) {
  const auto& observations = figures.pairs.observations;
  std::string script = "$data << EOD\n";
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Eigen::Vector3d d = kMmPerM * observations[i].difference_m();
    script += fmt::format("{} {:.5f} {:.5f} {:.5f} {:.5f} {:.5f}\n",
                          i + 1,
                          d.x(),
                          d.y(),
                          d.z(),
                          d.norm(),
                          std::sqrt(observations[i].standardised_2));
  }
  script += "EOD\n";
  script += PanelsScript(figures.spreads(),
                         observations.size(),
                         5,
                         fmt::format("tbm check: guidance against {} independent shots, {:.1f} % "
                                     "inside the published 95 % ellipsoid",
                                     observations.size(),
                                     InsidePercent(figures)));
  script += fmt::format(
      "set ylabel 'in sigmas'\nset xlabel 'observation'\nplot $data using 1:6 {} lc rgb '#8030a0' "
      "title 'distance in sigmas', 2.7955 lc rgb '#c0392b' dt 4 title '95 %'\n",
      PanelStyle(observations.size()));
  return script + std::string(kPanelsEnd);
}

}  // namespace tbm
