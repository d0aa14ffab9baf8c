#include "devices/app/station_state_file.h"

#include <array>
#include <cmath>
#include <filesystem>
#include <vector>

#include <fmt/format.h>

#include "devices/replay/csv.h"
#include "devices/replay/synced_file.h"
#include "pose/base/parse_number.h"

namespace tbm {
namespace {

// One line is a word and its values, separated by tabs: names may hold blanks. Numbers are written
// so that they read back to the bit.
constexpr std::string_view kHead = "tbm_station\t1";
constexpr std::size_t kMostBytes = 1 << 20;
constexpr std::size_t kMostRows = 64;  // references, controls; sightings twice that

std::uint32_t Crc32(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
  }
  return ~crc;
}

// A name comes from a config; what would break a line is left out of it.
std::string Plain(std::string_view text) {
  std::string plain;
  for (const char c : text) {
    if (static_cast<unsigned char>(c) >= 0x20) plain += c;
  }
  return plain;
}

class Writer {
 public:
  template <class... Values>
  void Line(std::string_view word, const Values&... values) {
    text_ += word;
    ((text_ += '\t', text_ += fmt::format("{}", values)), ...);
    text_ += '\n';
  }
  template <class Vector>
  void Numbers(std::string_view word, const Vector& values) {
    text_ += word;
    for (const double value : values) text_ += fmt::format("\t{}", value);
    text_ += '\n';
  }
  void SetUp(std::string_view role, const KeptSetUp& kept) {
    Line("set_up", role, kept.number);
    const Eigen::Vector3d& p = kept.station.p_axes_in_site;
    Line("station_m_rad", p.x(), p.y(), p.z(), kept.station.circle_zero_bearing_rad);
    Numbers("covariance", std::vector<double>(kept.covariance.data(), kept.covariance.data() + 16));
    Line("axis_errors_rad",
         kept.axis_errors.collimation_rad,
         kept.axis_errors.index_rad,
         kept.axis_sigma_rad);
    Line("times_ns", kept.set_up_at.ns, kept.last_good_check_at.ns);
    Line("fit", kept.chi2, kept.dof, kept.sees_m.value_or(std::nan("")), kept.instrument);
    for (const KeptReference& row : kept.references) {
      Line(
          "reference", Plain(row.name), row.is_used ? 1 : 0, row.reason.empty() ? "-" : row.reason);
      if (row.residual) {
        const SightingResidual& r = *row.residual;
        Line("residual",
             r.circle_rad,
             r.zenith_rad,
             r.slope_m.value_or(std::nan("")),
             r.across_m,
             r.up_m,
             r.checked_share,
             r.standardised);
      }
    }
    for (const ReferenceSighting& s : kept.sightings) {
      Line("sighting",
           s.reference,
           s.reading.circle_rad,
           s.reading.zenith_rad,
           s.reading.slope_m.value_or(std::nan("")),
           s.sigma.circle_rad,
           s.sigma.zenith_rad,
           s.sigma.slope_m);
    }
  }
  std::string Take() {
    text_ += fmt::format("crc32\t{:08x}\n", Crc32(text_));
    return std::move(text_);
  }

 private:
  std::string text_;
};

class Reader {
 public:
  Reader(std::string_view text, const std::string& file) : rest_(text), file_(file) {}

  Result<KeptStation, std::string> Read() {
    KeptStation kept;
    if (!Next() || line_ != kHead) return Wrong("not the state of a total station");
    if (!Next() || !Is("last_number", 1) || !Count(1, &kept.last_number)) {
      return Wrong("wanted last_number and a count");
    }
    if (!Next()) return Wrong("ends too early");
    while (word() == "set_up") {
      KeptSetUp set_up;
      const bool is_in_use = fields_.size() == 3 && fields_[1] == "in_use";
      if (!ReadSetUp(&set_up)) return Wrong(fault_);
      if (set_up.number > kept.last_number) return Wrong("a set-up's number is beyond last_number");
      (is_in_use ? kept.in_use : kept.previous) = std::move(set_up);
    }
    while (Is("control", 5)) {
      ControlPoint control;
      std::array<double, 3> p{};
      control.name = fields_[1];
      if (kept.controls.size() >= kMostRows || !Time(2, &control.at) || !Numbers(3, p)) {
        return Wrong("wanted control, name, ns, and three numbers");
      }
      control.p_in_site = {p[0], p[1], p[2]};
      kept.controls.push_back(control);
      if (!Next()) return Wrong("ends too early");
    }
    if (!Is("crc32", 1) || !rest_.empty()) return Wrong("nobody knows this line");
    return kept;
  }

 private:
  Failure<std::string> Wrong(std::string_view what) const {
    return Failure{fmt::format("{}:{}: {}", file_, number_, what)};
  }
  bool Fail(std::string_view what) {
    fault_ = what;
    return false;
  }
  bool Next() {
    ++number_;
    const std::size_t end = rest_.find('\n');
    if (end == std::string_view::npos) return false;
    line_ = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    fields_.clear();
    for (std::string_view left = line_;;) {
      const std::size_t tab = left.find('\t');
      fields_.emplace_back(left.substr(0, tab));
      if (tab == std::string_view::npos) break;
      left.remove_prefix(tab + 1);
    }
    return true;
  }
  std::string_view word() const { return fields_.empty() ? std::string_view() : fields_[0]; }
  bool Is(std::string_view wanted, std::size_t values) const {
    return word() == wanted && fields_.size() == values + 1;
  }
  bool Count(std::size_t field, std::uint64_t* value) const {
    const auto number = ParseInteger(fields_[field]);
    if (!number || *number < 0) return false;
    *value = static_cast<std::uint64_t>(*number);
    return true;
  }
  bool Time(std::size_t field, Timestamp* at) const {
    const auto number = ParseInteger(fields_[field]);
    if (!number || *number <= 0) return false;
    at->ns = *number;
    return true;
  }
  template <std::size_t N>
  bool Numbers(std::size_t field, std::array<double, N>& values) const {
    for (std::size_t i = 0; i < N; ++i) {
      const auto number = ParseReal(fields_[field + i]);
      if (!number || !std::isfinite(*number)) return false;
      values[i] = *number;
    }
    return true;
  }
  // NaN stands for nothing.
  bool Maybe(std::size_t field, std::optional<double>* value) const {
    const auto number = ParseReal(fields_[field]);
    if (!number || std::isinf(*number)) return false;
    if (!std::isnan(*number)) *value = *number;
    return true;
  }

  bool ReadSetUp(KeptSetUp* kept) {
    if (!Is("set_up", 2) || (fields_[1] != "in_use" && fields_[1] != "previous") ||
        !Count(2, &kept->number) || kept->number == 0) {
      return Fail("wanted set_up, in_use or previous, and a number from 1");
    }
    std::array<double, 4> station{};
    if (!Next() || !Is("station_m_rad", 4) || !Numbers(1, station)) {
      return Fail("wanted station_m_rad and four numbers");
    }
    kept->station = {{station[0], station[1], station[2]}, station[3]};
    std::array<double, 16> covariance{};
    if (!Next() || !Is("covariance", 16) || !Numbers(1, covariance)) {
      return Fail("wanted covariance and sixteen numbers");
    }
    kept->covariance = Eigen::Map<const Eigen::Matrix4d>(covariance.data());
    const bool is_covariance = kept->covariance.isApprox(kept->covariance.transpose(), 1e-6) &&
                               kept->covariance.diagonal().minCoeff() >= 0.0;
    if (!is_covariance) return Fail("the covariance is none");
    std::array<double, 3> axis_errors{};
    if (!Next() || !Is("axis_errors_rad", 3) || !Numbers(1, axis_errors) || axis_errors[2] < 0.0) {
      return Fail("wanted axis_errors_rad and three numbers");
    }
    kept->axis_errors = {axis_errors[0], axis_errors[1]};
    kept->axis_sigma_rad = axis_errors[2];
    if (!Next() || !Is("times_ns", 2) || !Time(1, &kept->set_up_at) ||
        !Time(2, &kept->last_good_check_at)) {
      return Fail("wanted times_ns and two instants");
    }
    return ReadFit(kept) && ReadReferences(kept) && ReadSightings(kept);
  }

  bool ReadFit(KeptSetUp* kept) {
    std::array<double, 1> chi2{};
    if (!Next() || !Is("fit", 4) || !Numbers(1, chi2) || chi2[0] < 0.0) {
      return Fail("wanted fit, chi2, dof, sees_m, serial number");
    }
    const auto dof = ParseInteger(fields_[2]);
    const auto instrument = ParseInteger(fields_[4]);
    if (!dof || *dof < -1 || *dof > 1000 || !instrument || !Maybe(3, &kept->sees_m) ||
        kept->sees_m.value_or(0.0) < 0.0) {
      return Fail("wanted fit, chi2, dof, sees_m, serial number");
    }
    kept->chi2 = chi2[0];
    kept->dof = static_cast<int>(*dof);
    kept->instrument = *instrument;
    return Next() || Fail("ends too early");
  }

  bool ReadReferences(KeptSetUp* kept) {
    while (Is("reference", 3)) {
      if (kept->references.size() >= kMostRows) return Fail("too many references");
      KeptReference row{std::string(fields_[1]), fields_[2] == "1", std::string(fields_[3]), {}};
      if (row.name.empty() || row.name.size() > 32 || row.reason.size() > 48) {
        return Fail("a reference's name has 1 to 32 characters");
      }
      if (row.reason == "-") row.reason.clear();
      if (!Next()) return Fail("ends too early");
      if (word() == "residual" && !ReadResidual(static_cast<int>(kept->references.size()), &row)) {
        return false;
      }
      kept->references.push_back(std::move(row));
    }
    return true;
  }

  bool ReadResidual(int reference, KeptReference* row) {
    SightingResidual r;
    std::array<double, 2> angles{};
    std::array<double, 4> rest{};
    if (!Is("residual", 7) || !Numbers(1, angles) || !Maybe(3, &r.slope_m) || !Numbers(4, rest)) {
      return Fail("wanted residual and seven numbers");
    }
    r.reference = reference;
    r.circle_rad = angles[0];
    r.zenith_rad = angles[1];
    r.across_m = rest[0];
    r.up_m = rest[1];
    r.checked_share = rest[2];
    r.standardised = rest[3];
    row->residual = r;
    return Next() || Fail("ends too early");
  }

  bool ReadSightings(KeptSetUp* kept) {
    while (Is("sighting", 7)) {
      ReferenceSighting s;
      std::uint64_t reference = 0;
      std::array<double, 2> angles{};
      std::array<double, 3> sigma{};
      const bool reads = kept->sightings.size() < 2 * kMostRows && Count(1, &reference) &&
                         reference < kept->references.size() && Numbers(2, angles) &&
                         Maybe(4, &s.reading.slope_m) && Numbers(5, sigma) && sigma[0] > 0.0 &&
                         sigma[1] > 0.0 && sigma[2] > 0.0;
      if (!reads) return Fail("wanted sighting, a reference above, and its numbers");
      s.reference = static_cast<int>(reference);
      s.reading.circle_rad = angles[0];
      s.reading.zenith_rad = angles[1];
      s.sigma = {sigma[0], sigma[1], sigma[2]};
      kept->sightings.push_back(s);
      if (!Next()) return Fail("ends too early");
    }
    return true;
  }

  std::string_view rest_;
  std::string_view line_;
  std::vector<std::string_view> fields_;
  const std::string& file_;
  std::string_view fault_;
  int number_ = 0;
};

}  // namespace

std::string TextOf(const KeptStation& kept) {
  Writer writer;
  writer.Line(kHead);
  writer.Line("last_number", kept.last_number);
  if (kept.in_use) writer.SetUp("in_use", *kept.in_use);
  if (kept.previous) writer.SetUp("previous", *kept.previous);
  for (const ControlPoint& control : kept.controls) {
    const Eigen::Vector3d& p = control.p_in_site;
    writer.Line("control", Plain(control.name), control.at.ns, p.x(), p.y(), p.z());
  }
  return writer.Take();
}

Result<KeptStation, std::string> ParseKeptStation(std::string_view text, const std::string& file) {
  const std::size_t sum_line = text.rfind("crc32\t");
  const bool is_whole =
      sum_line != std::string_view::npos && sum_line > 0 &&
      text.substr(sum_line) == fmt::format("crc32\t{:08x}\n", Crc32(text.substr(0, sum_line)));
  if (!is_whole) {
    return Failure{file + ":0: cut short or changed: its checksum is missing or does not fit"};
  }
  return Reader(text, file).Read();
}

Result<std::optional<KeptStation>, std::string> LoadKeptStation(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error) && !error) return std::optional<KeptStation>();
  auto text = ReadTextFile(path, kMostBytes);
  if (!text) return Failure{text.error().Text()};
  auto kept = ParseKeptStation(*text, path);
  if (!kept) return Failure{kept.error()};
  return std::optional<KeptStation>(std::move(kept).value());
}

int SaveKeptStation(const std::string& path, const KeptStation& kept) {
  if (const int error = WriteWhole(path, TextOf(kept)); error != 0) return error;
  const auto folder = std::filesystem::path(path).parent_path();
  return SyncFolder(folder.empty() ? "." : folder.string());
}

}  // namespace tbm
