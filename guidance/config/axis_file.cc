#include "guidance/config/axis_file.h"

#include <fmt/format.h>

#include "devices/replay/csv.h"
#include "guidance/config/axis_table.h"
#include "guidance/config/landxml.h"
#include "guidance/config/sha256.h"

namespace tbm {
namespace {

constexpr std::size_t kMostBytes = std::size_t{256} << 20;

Failure<AxisFileFaults> WholeFile(const std::string& file, std::string what) {
  return Failure{AxisFileFaults{{file, 0, "", std::move(what)}}};
}

}  // namespace

std::string AxisFileFault::Text() const {
  std::string text = file;
  if (line > 0) text += fmt::format(":{}", line);
  if (!place.empty()) text += ": " + place;
  return text + ": " + what;
}

Result<LoadedAxis, AxisFileFaults> ParseAxis(std::string_view bytes,
                                             const std::string& file,
                                             const AxisFileOptions& options) {
  std::string_view text = bytes;
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF") ||
      text.find('\0') != std::string_view::npos) {
    return WholeFile(file, "is not UTF-8 text (zero bytes or a UTF-16 mark); save it as UTF-8");
  }
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) {
    return WholeFile(file,
                     "is empty; LandXML or a CSV with the columns east_m,north_m,up_m is right");
  }
  auto loaded =
      text[first] == '<' ? ParseLandXml(text, file, options) : ParseAxisTable(text, file, options);
  if (!loaded) return loaded;
  LoadedAxis axis = std::move(loaded).value();
  axis.description.file_sha256 = Sha256(bytes);
  return axis;
}

Result<LoadedAxis, AxisFileFaults> LoadAxisFile(const std::string& path,
                                                const AxisFileOptions& options) {
  const auto text = ReadTextFile(path, kMostBytes);
  if (!text) return WholeFile(path, text.error().what);
  return ParseAxis(*text, path, options);
}

}  // namespace tbm
