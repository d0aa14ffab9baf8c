#include "devices/gsi/gsi_record.h"

#include <fmt/format.h>

#include "pose/base/parse_number.h"

namespace tbm {
namespace {

class RecordReader {
 public:
  RecordReader(const GsiBlock& block, const std::string& file) : block_(block), file_(file) {}

  std::optional<double> Length(int index) {
    return Read(index, GsiLengthM, "length; units 0, 1, 6, 7 and 8 are lengths");
  }
  std::optional<double> Angle(int index) {
    return Read(index, GsiAngleRad, "angle; units 2, 3, 4 and 5 are angles");
  }
  // Word 51: whole ppm, then whole millimetres with a sign of their own.
  void PpmAndConstant(GsiRecord& record) {
    const GsiWord* word = block_.Find(51);
    if (word == nullptr) return;
    const std::size_t sign = word->data.size() < 4 ? std::string_view::npos : word->data.size() - 4;
    const auto ppm =
        sign == std::string_view::npos ? std::nullopt : ParseInteger(word->data.substr(0, sign));
    const auto mm = ppm ? ParseInteger(word->data.substr(sign)) : std::nullopt;
    const bool has_sign = ppm && (word->data[sign] == '+' || word->data[sign] == '-');
    if (!ppm || *ppm < 0 || !mm || !has_sign) {
      return Refuse(*word, "ppm and millimetres; wanted digits, a sign and three digits");
    }
    record.ppm = static_cast<double>(word->is_negative ? -*ppm : *ppm);
    record.prism_constant_m = static_cast<double>(*mm) * 1e-3;
  }
  const std::optional<FileFault>& fault() const { return fault_; }

 private:
  std::optional<double> Read(int index,
                             std::optional<double> (*convert)(const GsiWord&),
                             const char* what) {
    const GsiWord* word = block_.Find(index);
    if (word == nullptr) return std::nullopt;
    const auto value = convert(*word);
    if (!value) Refuse(*word, what);
    return value;
  }
  void Refuse(const GsiWord& word, const char* what) {
    if (fault_) return;
    fault_ = FileFault{file_,
                       block_.line,
                       "",
                       fmt::format("word {} at character {}: unit {} with data {} is no {}",
                                   word.index,
                                   word.position,
                                   Quoted({&word.unit, 1}),
                                   Quoted(word.data),
                                   what)};
  }

  const GsiBlock& block_;
  const std::string& file_;
  std::optional<FileFault> fault_;
};

}  // namespace

Result<std::optional<GsiRecord>, FileFault> RecordOf(const GsiBlock& block,
                                                     const std::string& file) {
  const GsiWord* name = block.Find(11);
  if (name == nullptr) return std::optional<GsiRecord>();
  RecordReader reader(block, file);
  GsiRecord record;
  record.point = WithoutLeadingZeros(name->data);
  record.horizontal_rad = reader.Angle(21);
  record.zenith_rad = reader.Angle(22);
  record.slope_m = reader.Length(31);
  if (record.slope_m == 0.0) record.slope_m.reset();
  reader.PpmAndConstant(record);
  if (const auto constant_m = reader.Length(58)) record.prism_constant_m = constant_m;
  record.east_m = reader.Length(81);
  record.north_m = reader.Length(82);
  record.height_m = reader.Length(83);
  record.station_east_m = reader.Length(84);
  record.station_north_m = reader.Length(85);
  record.station_height_m = reader.Length(86);
  record.reflector_height_m = reader.Length(87);
  record.instrument_height_m = reader.Length(88);
  if (reader.fault()) return Failure{*reader.fault()};
  return std::optional<GsiRecord>(std::move(record));
}

}  // namespace tbm
