#include "hmi_bridge/core/history.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "idl/cpp/words.h"
#include "pose/base/check.h"

namespace tbm::hmi {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr std::int64_t kRowPeriod_ms = 1000;
// Further back than this the machine did not slip: it is another drive.
constexpr double kBackwards_m = 0.5;

// What is kept of one point in one row.
enum Cell : std::size_t { kRight, kUp, kRightSigma, kUpSigma, kChainageBehind, kValidity, kCells };

Json FloatOrNull(float value) { return Rounded(static_cast<double>(value), 2); }

}  // namespace

RowRing::RowRing(std::size_t most_rows, std::size_t row_width)
    : width_(row_width), at_(most_rows), chainage_(most_rows), rows_(most_rows * row_width) {
  TBM_CHECK(most_rows > 0);
}

void RowRing::Push(const std::vector<float>& row, std::int64_t at_utc_ms, double chainage_m) {
  TBM_CHECK(row.size() == width_);
  if (size_ == at_.size()) {
    first_ = (first_ + 1) % at_.size();
  } else {
    ++size_;
  }
  const std::size_t slot = Slot(size_ - 1);
  at_[slot] = at_utc_ms;
  chainage_[slot] = chainage_m;
  std::copy(row.begin(), row.end(), rows_.begin() + static_cast<std::ptrdiff_t>(slot * width_));
}

void RowRing::DropNewest() {
  TBM_CHECK(size_ > 0);
  --size_;
}

History::History(std::vector<std::string> points, std::string steer_by)
    : points_(std::move(points)),
      steer_by_(std::move(steer_by)),
      scratch_(points_.size() * kCells),
      by_time_(kMostSeconds, points_.size() * kCells),
      by_advance_(kMostSteps, points_.size() * kCells) {}

void History::Add(const dds::Guidance& guidance) {
  std::fill(scratch_.begin(), scratch_.end(), kNone);
  double steered_chainage_m = dds::kNaN;
  for (const dds::GuidedPoint& point : guidance.points) {
    if (point.name.view() == steer_by_) steered_chainage_m = point.chainage_m;
  }
  for (const dds::GuidedPoint& point : guidance.points) {
    const auto index = Find(point.name.view());
    if (!index) continue;
    float* cells = &scratch_[*index * kCells];
    cells[kRight] = static_cast<float>(point.deviation_right_m * 1e3);
    cells[kUp] = static_cast<float>(point.deviation_up_m * 1e3);
    cells[kRightSigma] = static_cast<float>(point.deviation_right_sigma_m * 1e3);
    cells[kUpSigma] = static_cast<float>(point.deviation_up_sigma_m * 1e3);
    // Against the steered point: a float holds this to a hundredth of a millimetre.
    cells[kChainageBehind] = static_cast<float>(steered_chainage_m - point.chainage_m);
    cells[kValidity] = static_cast<float>(point.validity);
  }
  const std::int64_t at_utc_ms = Milliseconds(guidance.valid_at);
  const bool is_due = by_time_.size() == 0 ||
                      at_utc_ms - by_time_.at_utc_ms(by_time_.size() - 1) >= kRowPeriod_ms ||
                      at_utc_ms < by_time_.at_utc_ms(by_time_.size() - 1) - kRowPeriod_ms;
  if (is_due) by_time_.Push(scratch_, at_utc_ms, steered_chainage_m);
  if (std::isfinite(steered_chainage_m)) AddAdvance(steered_chainage_m, at_utc_ms);
}

void History::AddAdvance(double chainage_m, std::int64_t at_utc_ms) {
  // After a return or another drive what lay ahead is no longer behind.
  while (by_advance_.size() > 0 &&
         by_advance_.chainage_m(by_advance_.size() - 1) > chainage_m + kBackwards_m) {
    by_advance_.DropNewest();
  }
  if (by_advance_.size() > 0 &&
      chainage_m < by_advance_.chainage_m(by_advance_.size() - 1) + kAdvanceStep_m) {
    return;
  }
  by_advance_.Push(scratch_, at_utc_ms, chainage_m);
}

std::optional<std::size_t> History::Find(std::string_view point) const {
  const auto found = std::find(points_.begin(), points_.end(), point);
  if (found == points_.end()) return {};
  return static_cast<std::size_t>(found - points_.begin());
}

Json History::Columns(const RowRing& ring,
                      std::size_t point,
                      const std::vector<std::size_t>& rows) const {
  Json at = Json::array();
  Json chainage = Json::array();
  Json right = Json::array();
  Json up = Json::array();
  Json right_sigma = Json::array();
  Json up_sigma = Json::array();
  Json validity = Json::array();
  for (const std::size_t row : rows) {
    const float* cells = ring.row(row) + point * kCells;
    at.push_back(ring.at_utc_ms(row));
    chainage.push_back(
        Rounded(ring.chainage_m(row) - static_cast<double>(cells[kChainageBehind]), 3));
    right.push_back(FloatOrNull(cells[kRight]));
    up.push_back(FloatOrNull(cells[kUp]));
    right_sigma.push_back(FloatOrNull(cells[kRightSigma]));
    up_sigma.push_back(FloatOrNull(cells[kUpSigma]));
    const bool is_known = std::isfinite(cells[kValidity]);
    validity.push_back(std::string(
        dds::WordOf(is_known ? static_cast<dds::Validity>(static_cast<int>(cells[kValidity]))
                             : dds::Validity::kInvalid)));
  }
  return {{"point", points_[point]},
          {"columns",
           {{"at_utc_ms", std::move(at)},
            {"chainage_m", std::move(chainage)},
            {"right_mm", std::move(right)},
            {"up_mm", std::move(up)},
            {"right_sigma_mm", std::move(right_sigma)},
            {"up_sigma_mm", std::move(up_sigma)},
            {"validity", std::move(validity)}}}};
}

std::optional<Json> History::Between(std::string_view point,
                                     std::int64_t from_utc_ms,
                                     std::int64_t to_utc_ms,
                                     std::size_t most_rows) const {
  TBM_CHECK(most_rows >= 2);
  const auto index = Find(point);
  if (!index) return {};
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < by_time_.size(); ++i) {
    if (by_time_.at_utc_ms(i) >= from_utc_ms && by_time_.at_utc_ms(i) <= to_utc_ms) {
      rows.push_back(i);
    }
  }
  if (rows.size() > most_rows) {
    std::vector<std::size_t> spread;
    for (std::size_t i = 0; i < most_rows; ++i) {
      spread.push_back(rows[i * (rows.size() - 1) / (most_rows - 1)]);
    }
    rows = std::move(spread);
  }
  return Columns(by_time_, *index, rows);
}

std::optional<Json> History::Back(std::string_view point, double length_m) const {
  const auto index = Find(point);
  if (!index) return {};
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < by_advance_.size(); ++i) {
    const double newest_m = by_advance_.chainage_m(by_advance_.size() - 1);
    if (by_advance_.chainage_m(i) >= newest_m - length_m) rows.push_back(i);
  }
  return Columns(by_advance_, *index, rows);
}

}  // namespace tbm::hmi
