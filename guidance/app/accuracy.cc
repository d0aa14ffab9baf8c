#include "guidance/app/accuracy.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

#include "devices/gsi/gsi.h"
#include "devices/gsi/survey_csv.h"

namespace tbm {
namespace {

Result<std::optional<Timestamp>, FileFault> OptionalStamp(const CsvTable& table,
                                                          std::size_t row,
                                                          std::size_t column) {
  if (table.Field(row, column).empty()) return std::optional<Timestamp>();
  const auto ns = table.Integer(row, column);
  if (!ns) return Failure{ns.error()};
  return std::optional<Timestamp>(Timestamp{*ns});
}

Result<Eigen::Vector3d, FileFault> ReadXyz(const CsvTable& table,
                                           std::size_t row,
                                           const std::array<std::size_t, 3>& columns) {
  Eigen::Vector3d xyz;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto value = table.Finite(row, columns[axis]);
    if (!value) return Failure{value.error()};
    xyz(static_cast<Eigen::Index>(axis)) = *value;
  }
  return xyz;
}

std::string Names(const std::set<std::string>& names) {
  constexpr std::size_t kMost = 12;
  std::string text;
  std::size_t shown = 0;
  for (const std::string& name : names) {
    if (++shown > kMost) return text + ", ..";
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "none" : text;
}

FileFault NoSuchPoint(const std::string& file,
                      std::string_view point,
                      const std::set<std::string>& names) {
  return {file, 0, "", fmt::format("has no point {}; it has {}", Quoted(point), Names(names))};
}

// Either all rows of a table have a stamp or none: a mixture would pair some rows in time and
// others in order.
std::optional<FileFault> MixedStamps(const std::vector<PlacedPoint>& points,
                                     const std::string& file) {
  for (const PlacedPoint& point : points) {
    if (point.at.has_value() != points.front().at.has_value()) {
      return FileFault{file,
                       point.line,
                       "stamp_ns",
                       "either every row has a stamp or none; this one differs from the first"};
    }
  }
  return std::nullopt;
}

Observation Observed(const PlacedPoint& survey, Pairing pairing, const Eigen::Vector3d& posed_mm) {
  return {survey.at, pairing, posed_mm, *survey.xyz_mm};
}

Result<Pairs, std::string> PairInOrder(const std::vector<PlacedPoint>& poses,
                                       const std::vector<PlacedPoint>& survey) {
  Pairs pairs;
  std::vector<const PlacedPoint*> chosen;
  chosen.reserve(poses.size());
  for (const PlacedPoint& pose : poses) chosen.push_back(&pose);
  if (chosen.size() != survey.size()) {
    std::erase_if(chosen, [](const PlacedPoint* pose) { return !pose->xyz_mm; });
  }
  if (chosen.size() != survey.size()) {
    return Failure{fmt::format(
        "without stamps the rows pair in order, but there are {} poses ({} with a position) and {} "
        "survey rows; give both files stamps or make the counts equal",
        poses.size(),
        chosen.size(),
        survey.size())};
  }
  for (std::size_t i = 0; i < survey.size(); ++i) {
    if (chosen[i]->xyz_mm) {
      pairs.observations.push_back(Observed(survey[i], Pairing::kInOrder, *chosen[i]->xyz_mm));
    } else {
      ++pairs.without_pose;
    }
  }
  return pairs;
}

void PairOne(const std::vector<PlacedPoint>& poses,
             const PlacedPoint& survey,
             Duration tolerance,
             Pairs& pairs) {
  const Timestamp at = *survey.at;
  const auto after =
      std::lower_bound(poses.begin(), poses.end(), at, [](const PlacedPoint& pose, Timestamp t) {
        return *pose.at < t;
      });
  if (after != poses.end() && *after->at == at) {
    if (after->xyz_mm) {
      pairs.observations.push_back(Observed(survey, Pairing::kExact, *after->xyz_mm));
    } else {
      ++pairs.without_pose;
    }
    return;
  }
  const PlacedPoint* later =
      after != poses.end() && *after->at - at <= tolerance ? &*after : nullptr;
  const PlacedPoint* earlier = nullptr;
  if (after != poses.begin() && at - *std::prev(after)->at <= tolerance)
    earlier = &*std::prev(after);
  const bool had_neighbour = later != nullptr || earlier != nullptr;
  if (later != nullptr && !later->xyz_mm) later = nullptr;
  if (earlier != nullptr && !earlier->xyz_mm) earlier = nullptr;
  if (earlier != nullptr && later != nullptr) {
    const double part = SecondsBetween(*earlier->at, at) / SecondsBetween(*earlier->at, *later->at);
    const Eigen::Vector3d posed_mm = *earlier->xyz_mm + part * (*later->xyz_mm - *earlier->xyz_mm);
    pairs.observations.push_back(Observed(survey, Pairing::kInterpolated, posed_mm));
  } else if (earlier != nullptr || later != nullptr) {
    pairs.observations.push_back(
        Observed(survey, Pairing::kNearest, *(earlier != nullptr ? earlier : later)->xyz_mm));
  } else {
    ++(had_neighbour ? pairs.without_pose : pairs.without_partner);
  }
}

}  // namespace

Result<std::vector<PlacedPoint>, FileFault> ReadPosedPoint(std::string text,
                                                           const std::string& file,
                                                           std::string_view point) {
  constexpr std::array<std::string_view, 2> kAlways = {"stamp_ns", "status"};
  const auto table = CsvTable::Parse(std::move(text), file, kAlways);
  if (!table) return Failure{table.error()};
  std::array<std::size_t, 3> xyz_columns{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto column = table->Column(fmt::format("{}_{}_mm", point, "xyz"[axis]));
    if (!column) {
      std::set<std::string> names;
      for (const std::string& name : table->columns()) {
        const bool is_fixed = name == "tx_mm" || name.starts_with("sigma_");
        if (!is_fixed && name.ends_with("_x_mm")) names.insert(name.substr(0, name.size() - 5));
      }
      return Failure{NoSuchPoint(file, point, names)};
    }
    xyz_columns[axis] = *column;
  }
  const std::size_t status_column = *table->Column("status");
  std::vector<PlacedPoint> poses;
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto stamp = OptionalStamp(*table, row, *table->Column("stamp_ns"));
    if (!stamp) return Failure{stamp.error()};
    PlacedPoint pose{*stamp, std::nullopt, table->line(row)};
    const std::string_view status = table->Field(row, status_column);
    if (status != "ok" && status != "degraded" && status != "none") {
      return Failure{
          table->FaultAt(row, status_column, Quoted(status) + " must be ok, degraded or none")};
    }
    if (status != "none") {
      const auto xyz_mm = ReadXyz(*table, row, xyz_columns);
      if (!xyz_mm) return Failure{xyz_mm.error()};
      pose.xyz_mm = *xyz_mm;
    }
    poses.push_back(pose);
  }
  if (auto fault = MixedStamps(poses, file)) return Failure{std::move(*fault)};
  return poses;
}

Result<SurveyLog, FileFault> ReadSurveyLog(std::string text,
                                           const std::string& file,
                                           std::string_view point) {
  const auto rows = ReadSurvey(std::move(text), file);
  if (!rows) return Failure{rows.error()};
  SurveyLog log;
  std::set<std::string> others;
  for (const SurveyRow& row : *rows) {
    if (WithoutLeadingZeros(row.point) != WithoutLeadingZeros(point)) {
      ++log.other_points;
      others.insert(row.point);
      continue;
    }
    log.points.push_back({row.at, Eigen::Vector3d(row.x_mm, row.y_mm, row.z_mm), row.line});
  }
  if (log.points.empty()) return Failure{NoSuchPoint(file, point, others)};
  if (auto fault = MixedStamps(log.points, file)) return Failure{std::move(*fault)};
  return log;
}

std::string_view PairingWord(Pairing pairing) {
  switch (pairing) {
    case Pairing::kInOrder:
      return "in_order";
    case Pairing::kExact:
      return "exact";
    case Pairing::kInterpolated:
      return "interpolated";
    case Pairing::kNearest:
      return "nearest";
  }
  return "";
}

Result<Pairs, std::string> PairUp(const std::vector<PlacedPoint>& poses,
                                  const std::vector<PlacedPoint>& survey,
                                  Duration tolerance) {
  if (poses.empty()) return Failure{std::string("the table of poses has no rows")};
  if (!poses.front().at || !survey.front().at) return PairInOrder(poses, survey);
  std::vector<PlacedPoint> sorted = poses;
  std::stable_sort(sorted.begin(), sorted.end(), [](const PlacedPoint& a, const PlacedPoint& b) {
    return *a.at < *b.at;
  });
  // Of two frames with one stamp the one that has a pose is kept.
  std::vector<PlacedPoint> unique;
  for (const PlacedPoint& pose : sorted) {
    if (!unique.empty() && *unique.back().at == *pose.at) {
      if (!unique.back().xyz_mm) unique.back() = pose;
    } else {
      unique.push_back(pose);
    }
  }
  Pairs pairs;
  for (const PlacedPoint& point : survey) PairOne(unique, point, tolerance, pairs);
  return pairs;
}

Alignment AlignRigid(Pairs& pairs) {
  auto& observations = pairs.observations;
  Eigen::Vector3d posed_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d surveyed_mean = Eigen::Vector3d::Zero();
  const auto count = static_cast<double>(observations.size());
  for (const Observation& observation : observations) {
    posed_mean += observation.posed_mm / count;
    surveyed_mean += observation.surveyed_mm / count;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Observation& observation : observations) {
    const Eigen::Vector3d surveyed = observation.surveyed_mm - surveyed_mean;
    cross += (observation.posed_mm - posed_mean) * surveyed.transpose();
    scatter += surveyed * surveyed.transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  // Without this the best fit of noisy or flat placements may be a mirror image.
  if ((svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0) signs.z() = -1.0;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();

  Alignment alignment;
  alignment.posed_from_surveyed.rotation = Eigen::Quaterniond(rotation).normalized();
  alignment.posed_from_surveyed.translation = posed_mean - rotation * surveyed_mean;
  // Placements whose spread in the second direction is below 1e-3 of the first stand on one line:
  // the turn about it does nothing.
  const Eigen::Vector3d spread = scatter.jacobiSvd().singularValues();
  alignment.degrees_of_freedom = spread(0) == 0.0 ? 3 : spread(1) < 1e-6 * spread(0) ? 5 : 6;
  for (Observation& observation : observations) {
    observation.surveyed_mm = rotation * (observation.surveyed_mm - surveyed_mean) + posed_mean;
  }
  return alignment;
}

Spread SpreadOf(std::vector<double> values_mm) {
  Spread spread;
  if (values_mm.empty()) return spread;
  const auto count = static_cast<double>(values_mm.size());
  double squares = 0.0;
  for (double& value : values_mm) {
    spread.mean_mm += value / count;
    squares += value * value;
    value = std::abs(value);
  }
  std::sort(values_mm.begin(), values_mm.end());
  spread.rms_mm = std::sqrt(squares / count);
  // In integers: 0.95 * 20 is a hair above 19 in binary.
  const std::size_t rank = (values_mm.size() * 95 + 99) / 100;
  spread.p95_mm = values_mm[rank - 1];
  spread.max_mm = values_mm.back();
  return spread;
}

}  // namespace tbm
