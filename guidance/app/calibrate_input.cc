#include "guidance/app/calibrate_input.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <set>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "pose/base/angle.h"
#include "pose/calibrate/find_board.h"
#include "pose/geometry/tilt.h"

namespace tbm {
namespace {

namespace fs = std::filesystem;

bool EndsWithOneOf(const fs::path& path, std::span<const std::string_view> endings) {
  std::string ending = path.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

std::string SizeFault(const std::string& path, ImageSize size, ImageSize wanted, bool is_given) {
  return fmt::format("{}: is {} x {} pixels, {} {} x {}; one camera's pictures have one size",
                     path,
                     size.width_px,
                     size.height_px,
                     is_given ? "and the camera's file is for" : "and the first picture has",
                     wanted.width_px,
                     wanted.height_px);
}

// Rows of the file, one after the other; what is wrong is collected.
class TiltRows {
 public:
  TiltRows(const CsvTable& table,
           const TiltTable& what,
           double default_sigma_deg,
           double beta_sign,
           double gamma_sign)
      : table_(table),
        noun_(what.noun),
        name_(*table.Column(what.column)),
        beta_(*table.Column("beta_deg")),
        gamma_(*table.Column("gamma_deg")),
        sigma_(table.Column("sigma_deg")),
        default_sigma_deg_(default_sigma_deg),
        beta_sign_(beta_sign),
        gamma_sign_(gamma_sign) {}

  void Read(std::size_t row) {
    const std::string name(table_.Field(row, name_));
    if (name.empty()) {
      return Fault(row, name_, fmt::format("is empty; it must name a {} of the folder", noun_));
    }
    if (!names_.insert(name).second) {
      return Fault(
          row,
          name_,
          fmt::format("{} stands twice; one reading belongs to a {}", Quoted(name), noun_));
    }
    const auto beta_deg = table_.Finite(row, beta_);
    const auto gamma_deg = table_.Finite(row, gamma_);
    for (const auto* angle : {&beta_deg, &gamma_deg}) {
      if (!*angle) faults_.push_back(angle->error());
    }
    const double sigma_deg = SigmaOf(row);
    if (!beta_deg || !gamma_deg) return;
    const auto up =
        UpInTilt({DegToRad(beta_sign_ * *beta_deg), DegToRad(gamma_sign_ * *gamma_deg)});
    if (!up) {
      return Fault(row,
                   beta_,
                   fmt::format("{} and gamma {} degrees are no two elevations of one housing; each "
                               "lies within -90 .. 90",
                               *beta_deg,
                               *gamma_deg));
    }
    rows_.push_back({name, table_.line(row), *up, DegToRad(sigma_deg)});
  }

  std::vector<CalibrationTilt>& rows() { return rows_; }
  FileFaults& faults() { return faults_; }

 private:
  double SigmaOf(std::size_t row) {
    if (!sigma_ || table_.Field(row, *sigma_).empty()) return default_sigma_deg_;
    const auto sigma_deg = table_.Finite(row, *sigma_);
    if (!sigma_deg) {
      faults_.push_back(sigma_deg.error());
    } else if (!(*sigma_deg > 0.0 && *sigma_deg <= 10.0)) {
      Fault(row, *sigma_, fmt::format("{} is not more than 0 .. 10 degrees", *sigma_deg));
    } else {
      return *sigma_deg;
    }
    return default_sigma_deg_;
  }

  void Fault(std::size_t row, std::size_t column, std::string what) {
    faults_.push_back(table_.FaultAt(row, column, std::move(what)));
  }

  const CsvTable& table_;
  std::string_view noun_;
  std::size_t name_;
  std::size_t beta_;
  std::size_t gamma_;
  std::optional<std::size_t> sigma_;
  double default_sigma_deg_;
  double beta_sign_;
  double gamma_sign_;
  std::set<std::string> names_;
  std::vector<CalibrationTilt> rows_;
  FileFaults faults_;
};

}  // namespace

std::optional<Board> BoardOf(const std::string& text, const Console& console) {
  const auto board = ParseBoard(text);
  if (board) return *board;
  Complain(console, fmt::format("--board {}: {}", Quoted(text), Advice(board.error())));
  return std::nullopt;
}

Result<std::vector<std::string>, std::string> NamesIn(const std::string& folder,
                                                      std::span<const std::string_view> endings) {
  std::error_code error;
  std::vector<std::string> names;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored) && EndsWithOneOf(entry->path(), endings)) {
      names.push_back(entry->path().filename().string());
    }
  }
  if (error)
    return Failure{fmt::format("{}: cannot be read as a folder: {}", folder, error.message())};
  std::sort(names.begin(), names.end());
  return names;
}

Result<std::vector<std::string>, std::string> PictureNames(const std::string& folder) {
  constexpr std::array<std::string_view, 4> kEndings = {".png", ".pgm", ".tif", ".tiff"};
  auto names = NamesIn(folder, kEndings);
  if (names && names->empty()) {
    return Failure{folder + ": holds no picture; grey .png, .pgm or .tiff files belong there"};
  }
  return names;
}

Result<FoundBoards, std::string> FindBoards(const std::string& folder,
                                            const std::vector<std::string>& names,
                                            const Board& board,
                                            std::optional<ImageSize> expected,
                                            const Console& console) {
  FoundBoards found;
  Progress progress(console, "pictures", names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string path = folder + "/" + names[i];
    const auto image = ReadImageFile(path);
    if (!image) return Failure{fmt::format("{}: {}", path, image.error().what)};
    if (i == 0) found.size = expected.value_or(image->size);
    if (image->size != found.size) {
      return Failure{SizeFault(path, image->size, found.size, expected.has_value())};
    }
    auto pixels = FindBoard(image->View(), board);
    if (pixels) {
      found.pictures.push_back({names[i], i});
      found.pixels_px.push_back(std::move(pixels).value());
    } else {
      found.not_found.push_back(names[i] + ": " + Text(pixels.error()));
    }
    progress.Show(i + 1);
  }
  return found;
}

Result<std::vector<CalibrationTilt>, FileFaults> ParseCalibrationTilts(std::string text,
                                                                       const std::string& file,
                                                                       const TiltTable& what,
                                                                       double default_sigma_deg,
                                                                       double beta_sign,
                                                                       double gamma_sign) {
  const std::array<std::string_view, 3> columns = {what.column, "beta_deg", "gamma_deg"};
  const auto table = CsvTable::Parse(std::move(text), file, columns);
  if (!table) return Failure{FileFaults{table.error()}};
  TiltRows rows(*table, what, default_sigma_deg, beta_sign, gamma_sign);
  for (std::size_t row = 0; row < table->row_count(); ++row) rows.Read(row);
  if (!rows.faults().empty()) return Failure{std::move(rows.faults())};
  if (rows.rows().empty()) {
    return Failure{
        FileFaults{{file, 0, "", fmt::format("has no rows; one belongs to each {}", what.noun)}}};
  }
  return std::move(rows.rows());
}

}  // namespace tbm
