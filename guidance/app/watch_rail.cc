#include "guidance/app/watch_rail.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "guidance/app/watch_board.h"
#include "guidance/app/watch_text.h"
#include "guidance/rail/chance.h"
#include "idl/cpp/words.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

using watch::AgeText;
using watch::LineHead;
using watch::Number;

constexpr double kMmInM = 1e3;

std::string Metres(const Eigen::Vector3d& place) {
  return fmt::format("{:.4f} {:.4f} {:.4f} m", place.x(), place.y(), place.z());
}
std::string SigmaMm(const Eigen::Vector3d& sigma_m) {
  return fmt::format(
      "{:.2f} {:.2f} {:.2f}", sigma_m.x() * kMmInM, sigma_m.y() * kMmInM, sigma_m.z() * kMmInM);
}
std::string Ago(double age_s) { return std::isfinite(age_s) ? AgeText(age_s) + " ago" : "never"; }

WatchStyle StyleOf(dds::RailPointStatus status) {
  switch (status) {
    case dds::RailPointStatus::kFixed:
      return WatchStyle::kGood;
    case dds::RailPointStatus::kBridged:
    case dds::RailPointStatus::kOpen:
      return WatchStyle::kDegraded;
    case dds::RailPointStatus::kGap:
    case dds::RailPointStatus::kNone:
      return WatchStyle::kBad;
  }
  return WatchStyle::kBad;
}

WatchStyle StyleOf(dds::CalibrationState state) {
  switch (state) {
    case dds::CalibrationState::kValid:
      return WatchStyle::kGood;
    case dds::CalibrationState::kUndated:
    case dds::CalibrationState::kDue:
      return WatchStyle::kDegraded;
    case dds::CalibrationState::kNone:
      return WatchStyle::kBad;
  }
  return WatchStyle::kBad;
}

// Puts a piece to the others of its run; a piece of another run begins anew.
template <class Gathered, class Piece, class IsSame>
void Gather(const Piece& piece, WatchInstant received_at, const IsSame& is_same, Gathered& of) {
  if (!of.pieces.empty() && !is_same(of.newest, piece)) of.pieces.clear();
  of.newest = piece;
  of.received_at = received_at;
  of.pieces.insert_or_assign(piece.piece, piece);
}

template <class Gathered>
bool IsWhole(const Gathered& of) {
  return of.pieces.size() == static_cast<std::size_t>(of.newest.pieces);
}

template <class Gathered>
std::string WholeText(const Gathered& of) {
  return IsWhole(of) ? "whole" : fmt::format("{} of {} pieces", of.pieces.size(), of.newest.pieces);
}

std::vector<dds::SettlementPoint> ComparedPlaces(
    const std::map<int, dds::SettlementPiece>& pieces) {
  std::vector<dds::SettlementPoint> compared;
  for (const auto& [number, piece] : pieces) {
    std::copy_if(piece.points.begin(),
                 piece.points.end(),
                 std::back_inserter(compared),
                 [](const dds::SettlementPoint& point) { return std::isfinite(point.dz_m); });
  }
  return compared;
}

// The largest change of those with the highest alert; without an alert, of those that are more than
// chance gives anywhere on the line.
std::optional<dds::SettlementPoint> WorstOf(const std::vector<dds::SettlementPoint>& compared,
                                            double level) {
  std::optional<dds::SettlementPoint> worst;
  for (const dds::SettlementPoint& point : compared) {
    if (point.alert == 0 && !IsMoreThanChance(point.dz_m, point.sigma_m, compared.size(), level)) {
      continue;
    }
    const auto weight = [](const dds::SettlementPoint& of) {
      return std::pair(of.alert, std::abs(of.dz_m));
    };
    if (!worst || weight(point) > weight(*worst)) worst = point;
  }
  return worst;
}

}  // namespace

void RailBoard::Add(const dds::TrolleyState& state, WatchInstant received_at) {
  trolleys_[std::string(state.machine_id)] = {state, received_at};
}
void RailBoard::Add(const dds::RailLinePiece& piece, WatchInstant received_at) {
  Gather(
      piece,
      received_at,
      [](const auto& a, const auto& b) {
        return a.run_id == b.run_id && a.line_sha256 == b.line_sha256;
      },
      lines_[std::string(piece.machine_id)]);
}
void RailBoard::Add(const dds::SettlementPiece& piece, WatchInstant received_at) {
  Gather(
      piece,
      received_at,
      [](const auto& a, const auto& b) {
        return a.base_sha256 == b.base_sha256 && a.later_sha256 == b.later_sha256;
      },
      settlements_[std::string(piece.machine_id)]);
}
void RailBoard::Add(const dds::CalibrationStatus& status, WatchInstant received_at) {
  calibrations_[fmt::format("{} {}", status.machine_id.view(), status.subject.view())] = {
      status, received_at};
}

bool RailBoard::is_empty() const {
  return trolleys_.empty() && lines_.empty() && settlements_.empty() && calibrations_.empty();
}

void RailBoard::Append(const WatchNow& now, std::vector<WatchRow>& rows) const {
  AppendTrolleys(now, rows);
  AppendLines(now, rows);
  AppendSettlements(now, rows);
  AppendCalibrations(now, rows);
}

void RailBoard::AppendTrolleys(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : trolleys_) {
    const dds::TrolleyState& state = heard.message;
    const bool has_numbers = state.status != dds::RailPointStatus::kNone;
    WatchRow row{"trolley " + key, "", "", "", "", StyleOf(state.status)};
    row.status = std::string(dds::WordOf(state.status));
    if (!state.reason.empty()) row.status += " " + std::string(state.reason);
    if (has_numbers) {
      row.value = fmt::format("at {}, {:.2f} m run, {:.2f} m/s, targets {}, rest {}",
                              Metres(state.position_world_m),
                              state.distance_m,
                              state.velocity_world_m_per_s.norm(),
                              Ago(state.target_age_s),
                              Ago(state.rest_age_s));
      row.sigma = SigmaMm(state.sigma_position_m);
    }
    rows.push_back(watch::AgeOf(heard.received_at, state.published_at, now, watch::kStalePoseS)
                       .Dress(std::move(row)));
  }
}

void RailBoard::AppendLines(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, line] : lines_) {
    const dds::RailLinePiece& newest = line.newest;
    WatchRow row{"line " + key, "", "", "", WholeText(line), WatchStyle::kPlain};
    row.value = fmt::format("{}: {} points", newest.run_id.view(), newest.points_in_all);
    if (IsWhole(line)) {
      Eigen::Vector3d worst_m = Eigen::Vector3d::Zero();
      for (const auto& [number, piece] : line.pieces) {
        for (const dds::RailLinePoint& point : piece.points) {
          worst_m = worst_m.cwiseMax(point.sigma_world_m);
        }
      }
      const auto& last = line.pieces.rbegin()->second.points;
      row.value += fmt::format(", {:.2f} m", last[last.size() - 1].distance_m);
      row.sigma = SigmaMm(worst_m);
    }
    row.age = AgeText(WatchAgeS(line.received_at, newest.published_at, now));
    rows.push_back(std::move(row));
  }
}

void RailBoard::AppendSettlements(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, of] : settlements_) {
    const dds::SettlementPiece& newest = of.newest;
    WatchRow row{"settlement " + key, "", "", "", WholeText(of), WatchStyle::kPlain};
    row.value = fmt::format("{} against {}", newest.later_run_id.view(), newest.base_run_id.view());
    if (IsWhole(of)) {
      const std::vector<dds::SettlementPoint> compared = ComparedPlaces(of.pieces);
      row.value += fmt::format(": {} of {} places compared", compared.size(), newest.points_in_all);
      if (const auto worst = WorstOf(compared, newest.level)) {
        row.value +=
            fmt::format(", {:+.2f} mm at {:.2f} m", worst->dz_m * kMmInM, worst->distance_m);
        row.sigma = fmt::format("{:.2f}", worst->sigma_m * kMmInM);
      } else if (!compared.empty()) {
        row.value += ", nothing moved that chance would not give";
      }
    }
    if (newest.highest_alert > 0) {
      row.status = fmt::format("ALERT {}, {}", newest.highest_alert, row.status);
      row.style = WatchStyle::kBad;
    }
    row.age = AgeText(WatchAgeS(of.received_at, newest.published_at, now));
    rows.push_back(std::move(row));
  }
}

void RailBoard::AppendCalibrations(const WatchNow& now, std::vector<WatchRow>& rows) const {
  for (const auto& [key, heard] : calibrations_) {
    const dds::CalibrationStatus& status = heard.message;
    WatchRow row{"calibration " + key, "", "", "", "", StyleOf(status.state)};
    row.value = std::isfinite(status.age_days) ? fmt::format("{:.0f} days old", status.age_days)
                                               : "of nobody knows when";
    if (std::isfinite(status.due_after_days)) {
      row.value += fmt::format(" of {:.0f}", status.due_after_days);
    }
    row.value += fmt::format(", used by {}", status.source.view());
    for (const dds::CalibrationSigma& sigma : status.sigmas) {
      if (!row.sigma.empty()) row.sigma += ", ";
      row.sigma += fmt::format("{} {:.2g} {}", sigma.what.view(), sigma.sigma, sigma.unit.view());
    }
    row.status = std::string(dds::WordOf(status.state));
    if (!status.reason.empty()) row.status += " " + std::string(status.reason);
    rows.push_back(watch::AgeOf(heard.received_at, status.published_at, now, watch::kStaleHealthS)
                       .Dress(std::move(row)));
  }
}

std::string WatchLine(const dds::TrolleyState& state, double age_s) {
  const bool is_stale = age_s > watch::kStalePoseS;
  std::string line = LineHead("trolley_state",
                              state.machine_id,
                              state.published_at,
                              age_s,
                              is_stale,
                              std::string(dds::WordOf(state.status)));
  if (!state.run_id.empty()) line += " run=" + watch::Harmless(state.run_id);
  if (!state.reason.empty()) line += " reason=" + watch::Harmless(state.reason);
  if (is_stale || state.status == dds::RailPointStatus::kNone) return line;
  const Eigen::Vector3d& p = state.position_world_m;
  line += Number("x_m", p.x(), 5) + Number("y_m", p.y(), 5) + Number("z_m", p.z(), 5);
  line += Number("distance_m", state.distance_m, 3);
  line += Number("sigma_mm", state.sigma_position_m.norm() * kMmInM, 3);
  return line + Number("target_age_s", state.target_age_s, 2) +
         Number("rest_age_s", state.rest_age_s, 2);
}

std::string WatchLine(const dds::RailLinePiece& piece, double age_s) {
  return LineHead("rail_line", piece.machine_id, piece.published_at, age_s, false, "ok") +
         fmt::format(" run={} piece={} pieces={} points={}",
                     watch::Harmless(piece.run_id),
                     piece.piece,
                     piece.pieces,
                     piece.points.size());
}

std::string WatchLine(const dds::SettlementPiece& piece, double age_s) {
  return LineHead("settlement", piece.machine_id, piece.published_at, age_s, false, "ok") +
         fmt::format(" base={} later={} piece={} pieces={} highest_alert={}",
                     watch::Harmless(piece.base_run_id),
                     watch::Harmless(piece.later_run_id),
                     piece.piece,
                     piece.pieces,
                     piece.highest_alert);
}

std::string WatchLine(const dds::CalibrationStatus& status, double age_s) {
  const bool is_stale = age_s > watch::kStaleHealthS;
  std::string line = LineHead("calibration_status",
                              status.machine_id,
                              status.published_at,
                              age_s,
                              is_stale,
                              std::string(dds::WordOf(status.state))) +
                     " subject=" + watch::Harmless(status.subject);
  if (!status.reason.empty()) line += " reason=" + watch::Harmless(status.reason);
  return is_stale ? line : line + Number("age_days", status.age_days, 1);
}

}  // namespace tbm
