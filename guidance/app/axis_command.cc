#include "guidance/app/axis_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string_view>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "guidance/app/csv_field.h"
#include "guidance/app/output_file.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

std::optional<LoadedAxis> LoadFile(const AxisSource& source, const Console& console) {
  auto loaded = LoadAxisFile(source.file, source.options);
  if (loaded) return std::move(loaded).value();
  for (const AxisFileFault& fault : loaded.error()) Complain(console, fault.Text());
  return std::nullopt;
}

std::string Official(const OfficialChainage& official) {
  return official.section == 0 ? fmt::format("{:.3f}", official.m)
                               : fmt::format("{:.3f} (section {})", official.m, official.section);
}

std::string SummaryText(const DesignAxis& axis) {
  std::string text =
      fmt::format("axis       {}\nsha256     {}\n", Quoted(axis.name()), axis.file_sha256());
  const auto line = [&](std::string_view what, InternalChainage from, InternalChainage to) {
    text += fmt::format("{:<10} {:.3f} .. {:.3f}, on the wall {} .. {}\n",
                        what,
                        from.m,
                        to.m,
                        Official(axis.equations().ToOfficial(from)),
                        Official(axis.equations().ToOfficial(to)));
  };
  line("chainage", axis.start(), axis.end());
  text += fmt::format("plan       {} elements, {:.3f} m\n",
                      axis.plan().element_count(),
                      axis.end().m - axis.start().m);
  if (axis.profile().exists()) {
    line("profile", axis.profile().start(), axis.profile().end());
  } else {
    text += "profile    none: this axis has no heights\n";
  }
  if (axis.equations().section_count() > 1) {
    text += fmt::format("equations  {}\n", axis.equations().section_count() - 1);
  }
  return text;
}

// A file of nothing but faults must not fill the screen.
constexpr std::size_t kMostOfAKind = 20;

std::string RemarksText(const AxisRemarks& remarks, const std::string& file) {
  std::string text;
  std::map<AxisRemarkCode, std::size_t> counts;
  for (const AxisRemark& remark : remarks) {
    if (++counts[remark.code] > kMostOfAKind) continue;
    text += fmt::format("{:<8} {}\n",
                        remark.severity == Severity::kRefused ? "refused" : "odd",
                        RemarkText(remark, file));
  }
  for (const auto& [code, count] : counts) {
    if (count <= kMostOfAKind) continue;
    text += fmt::format(
        "         and {} more of the kind {}\n", count - kMostOfAKind, RemarkCode(code));
  }
  return text;
}

nlohmann::json RemarksJson(const AxisRemarks& remarks) {
  nlohmann::json list = nlohmann::json::array();
  for (const AxisRemark& remark : remarks) {
    nlohmann::json item;
    item["code"] = std::string(RemarkCode(remark.code));
    item["refused"] = remark.severity == Severity::kRefused;
    item["line"] = remark.line;
    item["chainage_m"] = remark.at.m;
    item["size"] = remark.size;
    item["text"] = RemarkText(remark, "");
    list.push_back(item);
  }
  return list;
}

ExitCode Written(const std::string& out,
                 bool force,
                 const std::string& text,
                 const Console& console) {
  if (out == "-") {
    console.out << text;
    return ExitCode::kDone;
  }
  if (const auto fault = OutputFile(out, force).Write(text)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  return ExitCode::kDone;
}

std::string Optional(const std::optional<double>& value, double scale, int digits) {
  return value ? fmt::format("{:.{}f}", *value * scale, digits) : "";
}

constexpr std::string_view kEvalHeader =
    "chainage_m,official_m,official_section,east_m,north_m,up_m,bearing_deg,gradient_mm_per_m,"
    "curvature_right_per_m,curvature_up_per_m,cant_mm,roll_deg,axis_sha256\n";

std::string EvalRow(const AxisPoint& point, const DesignAxis& axis) {
  std::optional<double> cant_m;
  std::optional<double> roll_rad;
  if (point.cant) {
    cant_m = point.cant->left_over_right_m;
    roll_rad = point.cant->roll_rad;
  }
  return fmt::format("{:.6f},{:.6f},{},{:.6f},{:.6f},{},{:.8f},{},{:.10f},{},{},{},{}\n",
                     point.chainage.m,
                     point.official.m,
                     point.official.section,
                     point.p_plan_in_site.x(),
                     point.p_plan_in_site.y(),
                     Optional(point.up_m, 1.0, 6),
                     RadToDeg(point.bearing_rad),
                     Optional(point.gradient, 1e3, 6),
                     point.curvature_right_per_m,
                     Optional(point.curvature_up_per_m, 1.0, 10),
                     Optional(cant_m, 1e3, 3),
                     Optional(roll_rad, 180.0 / std::numbers::pi, 6),
                     axis.file_sha256());
}

// Where a number the user gave is; two places inside a long chain. Empty, with a complaint, where
// it is nowhere.
std::vector<InternalChainage> Places(double number_m,
                                     const AxisEvalRequest& request,
                                     const DesignAxis& axis,
                                     const Console& console) {
  std::vector<InternalChainage> places;
  if (request.is_official) {
    places = axis.equations().ToInternal(number_m, axis.start(), axis.end());
  } else if (axis.At({number_m})) {
    places = {{number_m}};
  }
  if (places.empty()) {
    Complain(
        console,
        fmt::format("{}: chainage {} {}; the axis goes from {:.3f} to {:.3f}, on the wall from "
                    "{} to {}",
                    request.source.file,
                    number_m,
                    request.is_official ? "stands nowhere on the wall" : "is outside",
                    axis.start().m,
                    axis.end().m,
                    Official(axis.equations().ToOfficial(axis.start())),
                    Official(axis.equations().ToOfficial(axis.end()))));
  }
  return places;
}

// The chainages asked for, or nothing after a complaint.
std::vector<InternalChainage> Wanted(const AxisEvalRequest& request,
                                     const DesignAxis& axis,
                                     const Console& console) {
  std::vector<InternalChainage> wanted;
  for (const double at_m : request.at_m) {
    const auto places = Places(at_m, request, axis, console);
    if (places.empty()) return {};
    wanted.insert(wanted.end(), places.begin(), places.end());
  }
  if (!request.at_m.empty()) return wanted;
  const auto end_of = [&](const std::optional<double>& number, InternalChainage otherwise) {
    if (!number) return std::vector<InternalChainage>{otherwise};
    return Places(*number, request, axis, console);
  };
  const auto from = end_of(request.from_m, axis.start());
  const auto to = end_of(request.to_m, axis.end());
  if (from.empty() || to.empty()) return {};
  // Of two places with one number the first begins and the last ends, so that nothing is left out.
  const double length_m = to.back().m - from.front().m;
  constexpr double kMostRows = 1e7;
  if (!(length_m >= 0.0) || !(length_m / request.step_m < kMostRows)) {
    Complain(console,
             fmt::format("from {} to {} in steps of {} m gives no, or too many, rows",
                         from.front().m,
                         to.back().m,
                         request.step_m));
    return {};
  }
  const auto steps = static_cast<std::size_t>(length_m / request.step_m + 1e-9);
  for (std::size_t i = 0; i <= steps; ++i) {
    wanted.push_back({from.front().m + static_cast<double>(i) * request.step_m});
  }
  if (to.back().m - wanted.back().m > 1e-6) wanted.push_back(to.back());
  return wanted;
}

std::string_view ReasonText(AxisFailure failure) {
  switch (failure) {
    case AxisFailure::kBeforeStart:
      return "before_start";
    case AxisFailure::kBeyondEnd:
      return "beyond_end";
    case AxisFailure::kTooFar:
      return "too_far";
    case AxisFailure::kAmbiguous:
      return "ambiguous";
    case AxisFailure::kNotFinite:
      return "not_finite";
    case AxisFailure::kNoProfile:
      return "no_profile";
  }
  return "";
}

constexpr std::string_view kProjectHeader =
    "point,status,reason,chainage_m,official_m,official_section,deviation_right_mm,deviation_up_mm,"
    "bearing_deg,gradient_mm_per_m,other_chainage_m,axis_sha256\n";

std::string ProjectRow(std::string_view name,
                       const Result<AxisPosition, AxisFailure>& position,
                       const DesignAxis& axis) {
  if (!position) {
    return fmt::format(
        "{},none,{},,,,,,,,,{}\n", name, ReasonText(position.error()), axis.file_sha256());
  }
  std::optional<double> other_m;
  if (position->other_foot) other_m = position->other_foot->m;
  return fmt::format("{},ok,,{:.6f},{:.6f},{},{:.4f},{},{:.8f},{},{},{}\n",
                     name,
                     position->chainage.m,
                     position->official.m,
                     position->official.section,
                     1e3 * position->deviation_right_m,
                     Optional(position->deviation_up_m, 1e3, 4),
                     RadToDeg(position->bearing_rad),
                     Optional(position->gradient, 1e3, 6),
                     Optional(other_m, 1.0, 6),
                     axis.file_sha256());
}

Result<std::string, FileFault> ProjectTable(const CsvTable& table,
                                            const AxisProjectRequest& request,
                                            const DesignAxis& axis) {
  const std::array<std::size_t, 3> columns = {
      *table.Column("east_m"), *table.Column("north_m"), *table.Column("up_m")};
  const auto name_column = table.Column("point");
  const auto near_column = table.Column("near_m");
  std::string text(kProjectHeader);
  for (std::size_t row = 0; row < table.row_count(); ++row) {
    Eigen::Vector3d p_in_site;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      const auto number = table.Finite(row, columns[i]);
      if (!number) return Failure{number.error()};
      p_in_site[static_cast<Eigen::Index>(i)] =
          *number - request.source.options.site_origin[static_cast<Eigen::Index>(i)];
    }
    std::optional<InternalChainage> hint;
    if (request.near_m) hint = InternalChainage{*request.near_m};
    if (near_column && !table.Field(row, *near_column).empty()) {
      const auto near = table.Finite(row, *near_column);
      if (!near) return Failure{near.error()};
      hint = InternalChainage{*near};
    }
    const std::string name =
        name_column ? CsvField(table.Field(row, *name_column)) : fmt::format("{}", row + 1);
    text += ProjectRow(name, axis.Project(p_in_site, hint, request.reach_m), axis);
  }
  return text;
}

}  // namespace

std::optional<DesignAxis> LoadAxis(const AxisSource& source, const Console& console) {
  const auto loaded = LoadFile(source, console);
  if (!loaded) return std::nullopt;
  auto axis = DesignAxis::Build(loaded->description);
  if (axis) return std::move(axis).value();
  for (const AxisRemark& remark : axis.error()) {
    if (remark.severity == Severity::kRefused) Complain(console, RemarkText(remark, source.file));
  }
  Complain(console, source.file + ": no axis can be made of it; `tbm axis check` tells all");
  return std::nullopt;
}

ExitCode RunAxisCheck(const AxisCheckRequest& request, const Console& console) {
  const auto loaded = LoadFile(request.source, console);
  if (!loaded) return ExitCode::kBadInput;
  const AxisRemarks remarks = Inspect(loaded->description);
  const auto axis = DesignAxis::Build(loaded->description);
  if (request.as_json) {
    nlohmann::json json;
    json["file"] = request.source.file;
    json["axis"] = loaded->description.name;
    json["axis_sha256"] = loaded->description.file_sha256;
    json["usable"] = axis.has_value();
    json["remarks"] = RemarksJson(remarks);
    json["warnings"] = nlohmann::json::array();
    for (const AxisFileFault& warning : loaded->warnings)
      json["warnings"].push_back(warning.Text());
    // Names in a file may be bytes that are no UTF-8.
    console.out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
  } else {
    if (axis) console.out << SummaryText(*axis);
    for (const AxisFileFault& warning : loaded->warnings) {
      console.out << "odd      " << warning.Text() << "\n";
    }
    console.out << RemarksText(remarks, request.source.file);
    console.out << (!axis             ? "no axis can be made of this file\n"
                    : remarks.empty() ? "nothing odd\n"
                                      : fmt::format("{} remarks\n", remarks.size()));
  }
  return axis ? ExitCode::kDone : ExitCode::kBadInput;
}

ExitCode RunAxisEval(const AxisEvalRequest& request, const Console& console) {
  if (const auto obstacle = OutputFile(request.out, request.force).Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto axis = LoadAxis(request.source, console);
  if (!axis) return ExitCode::kBadInput;
  const auto wanted = Wanted(request, *axis, console);
  if (wanted.empty()) return ExitCode::kBadInput;
  std::string text(kEvalHeader);
  for (const InternalChainage chainage : wanted) {
    const auto point = axis->At(chainage);
    TBM_CHECK(point.has_value());
    text += EvalRow(*point, *axis);
  }
  return Written(request.out, request.force, text, console);
}

ExitCode RunAxisProject(const AxisProjectRequest& request, const Console& console) {
  if (const auto obstacle = OutputFile(request.out, request.force).Obstacle()) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  const auto axis = LoadAxis(request.source, console);
  if (!axis) return ExitCode::kBadInput;
  auto text = ReadTextFile(request.points);
  if (!text) {
    Complain(console, text.error().Text());
    return ExitCode::kBadInput;
  }
  constexpr std::array<std::string_view, 3> kRequired = {"east_m", "north_m", "up_m"};
  const auto table = CsvTable::Parse(std::move(text).value(), request.points, kRequired);
  if (!table) {
    Complain(console, table.error().Text());
    return ExitCode::kBadInput;
  }
  const auto rows = ProjectTable(*table, request, *axis);
  if (!rows) {
    Complain(console, rows.error().Text());
    return ExitCode::kBadInput;
  }
  return Written(request.out, request.force, *rows, console);
}

}  // namespace tbm
