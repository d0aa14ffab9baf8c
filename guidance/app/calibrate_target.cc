#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "guidance/app/calibrate_command.h"
#include "guidance/app/calibrate_input.h"
#include "guidance/app/output_file.h"
#include "guidance/app/target_input.h"
#include "guidance/app/target_report.h"
#include "pose/base/angle.h"
#include "pose/base/length.h"
#include "pose/calibrate/misfit.h"

namespace tbm {
namespace {

constexpr const char* kTiltTable = "tilt.csv";
// Two pointings at one LED further apart than so many sigmas are of two placements.
constexpr double kMostApart = 8.0;

struct Measured {
  std::vector<std::string> files;
  std::vector<TargetPlacement> placements;
};

std::optional<std::vector<std::string>> PlacementFiles(const std::string& folder,
                                                       const Console& console) {
  constexpr std::array<std::string_view, 2> kEndings = {".csv", ".gsi"};
  auto names = NamesIn(folder, kEndings);
  if (!names) {
    Complain(console, names.error());
    return std::nullopt;
  }
  std::vector<std::string> files = std::move(names).value();
  std::erase(files, kTiltTable);
  if (files.empty()) {
    Complain(console,
             folder +
                 ": holds no placement; a .csv (stamp_ns,point,x_mm,y_mm,z_mm) or .gsi file of "
                 "points for each stand of the board belongs there");
    return std::nullopt;
  }
  return files;
}

std::optional<Measured> ReadPlacements(const CalibrateTargetRequest& request,
                                       const std::vector<Led>& leds,
                                       const Console& console) {
  const auto files = PlacementFiles(request.folder, console);
  if (!files) return std::nullopt;
  Measured measured;
  bool is_good = true;
  std::set<std::string> others;
  for (const std::string& file : *files) {
    const std::string path = request.folder + "/" + file;
    auto text = ReadTextFile(path, 1 << 24);
    if (!text) {
      Complain(console, text.error().Text());
      return std::nullopt;
    }
    const auto points =
        ParsePlacement(std::move(text).value(), path, leds, kMostApart * request.sigma_mm);
    if (!points) {
      Complain(console, points.error());
      is_good = false;
      continue;
    }
    others.insert(points->others.begin(), points->others.end());
    measured.files.push_back(file);
    measured.placements.push_back(
        {points->led_in_site_m, request.sigma_mm / kMmPerMetre, std::nullopt, 0.0});
  }
  if (!is_good) return std::nullopt;
  if (!others.empty()) {
    Complain(console,
             fmt::format("warning: passed over, as no LED has such a name: {}",
                         fmt::join(others, ", ")));
  }
  return measured;
}

// The files that a name in tilt.csv may mean: it has the ending, or leaves it out.
std::vector<std::size_t> FilesNamed(const std::string& name,
                                    const std::vector<std::string>& files) {
  std::vector<std::size_t> named;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (name == files[i]) return {i};
    if (name == std::filesystem::path(files[i]).stem().string()) named.push_back(i);
  }
  return named;
}

// What is wrong with a row's name; `lines` says where each placement has its reading already.
std::optional<std::string> NameFault(const CalibrationTilt& tilt,
                                     const std::vector<std::string>& files,
                                     const std::vector<int>& lines) {
  const std::vector<std::size_t> named = FilesNamed(tilt.name, files);
  if (named.empty()) {
    return fmt::format(
        "{} is no file of the folder; it has {}", Quoted(tilt.name), fmt::join(files, ", "));
  }
  if (named.size() > 1) {
    return fmt::format("{} may be {} or {}; write the ending as well",
                       Quoted(tilt.name),
                       files[named[0]],
                       files[named[1]]);
  }
  if (lines[named[0]] == 0) return {};
  return fmt::format("{} has its reading in line {} already; one belongs to a placement",
                     files[named[0]],
                     lines[named[0]]);
}

// Puts the readings to their placements. False, and said, where a row cannot be used.
bool ReadTilts(const CalibrateTargetRequest& request, Measured* measured, const Console& console) {
  const std::string path = request.folder + "/" + kTiltTable;
  if (std::error_code ignored; !std::filesystem::exists(path, ignored)) return true;
  auto text = ReadTextFile(path, 1 << 20);
  if (!text) {
    Complain(console, text.error().Text());
    return false;
  }
  const auto tilts = ParseCalibrationTilts(std::move(text).value(),
                                           path,
                                           kTiltOfPlacement,
                                           request.sigma_deg,
                                           request.sign[0],
                                           request.sign[1]);
  if (!tilts) {
    Complain(console, tilts.error());
    return false;
  }
  FileFaults faults;
  std::vector<int> lines(measured->files.size(), 0);
  for (const CalibrationTilt& tilt : *tilts) {
    if (auto fault = NameFault(tilt, measured->files, lines)) {
      faults.push_back({path, tilt.line, "placement", std::move(*fault)});
      continue;
    }
    const std::size_t at = FilesNamed(tilt.name, measured->files)[0];
    lines[at] = tilt.line;
    measured->placements[at].up_in_housing = tilt.up_in_housing;
    measured->placements[at].tilt_sigma_rad = tilt.sigma_rad;
  }
  Complain(console, faults);
  return faults.empty();
}

std::vector<Eigen::Vector3d> PlacesOf(const std::vector<Led>& leds) {
  std::vector<Eigen::Vector3d> places_m;
  for (const Led& led : leds) places_m.push_back(led.p_led_in_target);
  return places_m;
}

std::string NamesOf(const TargetPlacement& placement, const std::vector<Led>& leds) {
  std::vector<std::string> ids;
  for (std::size_t j = 0; j < leds.size(); ++j) {
    if (placement.led_in_site_m[j]) ids.push_back(leds[j].id);
  }
  return fmt::format("{}", fmt::join(ids, ", "));
}

std::string Exchanged(const std::vector<std::size_t>& really, const std::vector<Led>& leds) {
  std::vector<std::string> list;
  for (std::size_t j = 0; j < really.size(); ++j) {
    if (really[j] == j) continue;
    list.push_back(fmt::format("the point named {} is {}", leds[j].id, leds[really[j]].id));
  }
  return fmt::format("{}", fmt::join(list, ", "));
}

// The two LEDs whose distance differs most from what it should be.
std::string WorstDistance(const TargetPlacement& placement, const std::vector<Led>& leds) {
  std::string text;
  double worst_m = 0.0;
  for (std::size_t i = 0; i < leds.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const auto& a = placement.led_in_site_m[i];
      const auto& b = placement.led_in_site_m[j];
      if (!a || !b) continue;
      const double measured_m = (*a - *b).norm();
      const double nominal_m = (leds[i].p_led_in_target - leds[j].p_led_in_target).norm();
      if (std::abs(measured_m - nominal_m) <= worst_m) continue;
      worst_m = std::abs(measured_m - nominal_m);
      text = fmt::format("from {} to {} it is {:.2f} mm, and should be {:.2f}",
                         leds[j].id,
                         leds[i].id,
                         kMmPerMetre * measured_m,
                         kMmPerMetre * nominal_m);
    }
  }
  return text;
}

std::string OtherBoard(const TargetCalibrationFailure& failure,
                       const CalibrateTargetRequest& request,
                       const TargetPlacement& placement,
                       const std::vector<Led>& leds) {
  std::string text = fmt::format(
      "this is not the board of {}: however it is laid on, an LED is {:.2f} mm off ({} is allowed, "
      "--most-off-mm); {}",
      request.nominal,
      kMmPerMetre * failure.off_m,
      request.most_off_mm,
      WorstDistance(placement, leds));
  if (std::abs(failure.scale * kMmPerMetre - 1.0) < 0.2)
    text += "; are these columns in m? They are read as mm";
  if (std::abs(failure.scale / kMmPerMetre - 1.0) < 0.2)
    text += "; is the drawing in m? It is read as mm";
  return text;
}

// A line for each point that does not fit; some cannot be told apart.
std::vector<std::string> WrongPoints(const std::vector<WrongTargetPoint>& wrong,
                                     const CalibrateTargetRequest& request,
                                     const Measured& measured,
                                     const std::vector<Led>& leds) {
  const auto name = [&](const TargetPoint& point) {
    return fmt::format(
        "{}/{}: {}", request.folder, measured.files[point.placement], leds[point.led].id);
  };
  std::vector<std::string> lines;
  for (const WrongTargetPoint& one : wrong) {
    const double off_mm = kMmPerMetre * one.off_m;
    if (one.or_rather.empty()) {
      lines.push_back(fmt::format(
          "{} is {:.2f} mm from where all other points put it, and measuring explains {} mm "
          "(--sigma-mm); measure it again there, or take the row out",
          name(one.point),
          off_mm,
          request.sigma_mm));
      continue;
    }
    std::string names = name(one.point);
    for (const TargetPoint& other : one.or_rather) names += ", " + name(other);
    lines.push_back(fmt::format(
        "{}: contradict one another: one of them is {:.2f} mm off, and measuring explains {} mm "
        "(--sigma-mm); measure them again, or add another placement, which may tell",
        names,
        off_mm,
        request.sigma_mm));
  }
  return lines;
}

std::string Scattered(const TargetCalibrationFailure& failure,
                      const CalibrateTargetRequest& request,
                      const Measured& measured,
                      const std::vector<Led>& leds) {
  const WrongTargetPoint& worst = failure.wrong[0];
  return fmt::format(
      "{}: the points scatter {:.1f} times as much as --sigma-mm {} says, three times is the most, "
      "and no few of them are to blame; say what this total station can do, or measure again; the "
      "worst is {}: {}, {:.2f} mm from where all others put it",
      request.folder,
      failure.sigma_factor,
      request.sigma_mm,
      measured.files[worst.point.placement],
      leds[worst.point.led].id,
      kMmPerMetre * worst.off_m);
}

// One line, or one for each point.
std::vector<std::string> Explain(const TargetCalibrationFailure& failure,
                                 const CalibrateTargetRequest& request,
                                 const Measured& measured,
                                 const std::vector<Led>& leds) {
  const std::string& led = leds[failure.led].id;
  const std::string file = request.folder + "/" + measured.files[failure.placement];
  const TargetPlacement& placement = measured.placements[failure.placement];
  switch (failure.fault) {
    case TargetCalibrationFault::kTooFewLeds:
      return {fmt::format("{}: has {} only; three LEDs or more are needed, not on one line",
                          file,
                          NamesOf(placement, leds))};
    case TargetCalibrationFault::kNeverMeasured:
      return {
          fmt::format("{}: LED {} was measured in no placement; measure it, or take it out of {}",
                      request.folder,
                      led,
                      request.nominal)};
    case TargetCalibrationFault::kOnOneLine:
      return {fmt::format(
          "{}: its LEDs {} stand on one line, so nobody can tell how the board is turned about it; "
          "measure one beside it as well",
          file,
          NamesOf(placement, leds))};
    case TargetCalibrationFault::kExchanged:
      return {
          fmt::format("{}: names are exchanged: {}; give each point the name painted at its LED",
                      file,
                      Exchanged(failure.really, leds))};
    case TargetCalibrationFault::kMirrored:
      return {fmt::format(
          "{}: the points are a mirror image of the board: two columns are exchanged, or one has "
          "the wrong sign; right is x, y, z = east, north, height",
          file)};
    case TargetCalibrationFault::kDoesNotFit:
      return WrongPoints(failure.wrong, request, measured, leds);
    case TargetCalibrationFault::kScatters:
      return {Scattered(failure, request, measured, leds)};
    case TargetCalibrationFault::kOtherBoard:
      return {file + ": " + OtherBoard(failure, request, placement, leds)};
  }
  return {file};
}

// With one of the two angles counted the other way the readings may fit: then that is what is
// wrong.
bool FitsMirrored(const std::vector<Eigen::Vector3d>& nominal_m,
                  Measured measured,
                  double most_off_m) {
  for (TargetPlacement& placement : measured.placements) {
    if (placement.up_in_housing) placement.up_in_housing->x() *= -1.0;
  }
  const auto found = CalibrateTarget(nominal_m, measured.placements, most_off_m);
  return found && found->housing_from_target.has_value();
}

// Readings that the points and the other readings contradict.
void SayWrongReadings(const std::vector<WrongTilt>& readings,
                      const CalibrateTargetRequest& request,
                      const std::vector<std::string>& files,
                      const Console& console) {
  for (const WrongTilt& wrong : readings) {
    std::string names = files[wrong.placement];
    for (const std::size_t other : wrong.or_rather) names += " or " + files[other];
    Complain(console,
             fmt::format("{}/{}: the reading of {} is {:.3f} degrees from where the points and all "
                         "other readings put it, and measuring explains {:.3f}",
                         request.folder,
                         kTiltTable,
                         names,
                         RadToDeg(wrong.off_rad),
                         RadToDeg(wrong.sigma_rad)));
  }
}

// What is not right, but no reason to stop. False: it is one.
bool JudgeMounting(const TargetResult& result, const Measured& measured, const Console& console) {
  const TargetCalibration& found = result.found;
  if (!found.mounting_missing) return true;
  const auto readings = static_cast<std::size_t>(std::count_if(
      measured.placements.begin(), measured.placements.end(), [](const TargetPlacement& one) {
        return one.up_in_housing.has_value();
      }));
  const bool contradicts = found.mounting_missing->fault == TiltRotationFault::kNoRotation ||
                           found.mounting_missing->fault == TiltRotationFault::kDoesNotFit;
  std::string text = MissingForMounting(*found.mounting_missing, readings);
  if (contradicts) {
    const double most_off_m = result.request.most_off_mm / kMmPerMetre;
    if (FitsMirrored(PlacesOf(result.nominal), measured, most_off_m)) {
      text += fmt::format("; with --sign {:.0f} {:.0f} they would fit",
                          -result.request.sign[0],
                          result.request.sign[1]);
    } else {
      SayWrongReadings(found.mounting_missing->wrong, result.request, result.files, console);
    }
    Complain(console, fmt::format("{}/{}: no R1: {}", result.request.folder, kTiltTable, text));
    return false;
  }
  Complain(console,
           fmt::format("warning: no R1, the mounting of the board's inclinometer: {} ({}/{}: "
                       "placement,beta_deg,gamma_deg)",
                       text,
                       result.request.folder,
                       kTiltTable));
  return true;
}

void WarnOfPoints(const TargetResult& result, const Console& console) {
  const TargetCalibration& found = result.found;
  if (found.dof <= 0) {
    Complain(console,
             "warning: nothing controls the points: each LED was measured in one placement only, "
             "and a wrong point stays unseen; add a second placement");
  }
  for (const TargetSighting& sighting : found.sightings) {
    const double factor2 = found.sigma_factor * found.sigma_factor;
    if (sighting.controlled == 0) continue;
    if (sighting.misfit < factor2 * DoubtfulMisfit(sighting.controlled)) continue;
    Complain(
        console,
        fmt::format("warning: {}/{}: {} is {:.2f} mm from where all other points put it, which "
                    "measuring to {} mm explains once in a thousand; look at it again",
                    result.request.folder,
                    result.files[sighting.placement],
                    result.nominal[sighting.led].id,
                    kMmPerMetre * sighting.from_others_m,
                    result.request.sigma_mm));
  }
  if (found.sigma_factor > 1.0) {
    Complain(console,
             fmt::format("warning: the points scatter {:.1f} times as much as --sigma-mm {} says; "
                         "every sigma is that much larger",
                         found.sigma_factor,
                         result.request.sigma_mm));
  }
  if (found.mounting_factor > 1.0) {
    Complain(console,
             fmt::format("warning: the readings are {:.1f} times as far off as their sigma and the "
                         "points' say; the sigma of the mounting is that much larger",
                         found.mounting_factor));
  }
}

ExitCode WriteAll(const TargetResult& result, const ReportFolder& report, const Console& console) {
  const CalibrateTargetRequest& request = result.request;
  std::optional<std::string> fault;
  if (report.is_wanted()) fault = report.File("csv").Write(TargetCsv(result));
  if (report.is_wanted() && !fault) fault = report.File("json").Write(TargetJson(result));
  if (!fault) fault = OutputFile(request.out, request.force).Write(TargetPartYaml(result));
  if (fault) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  if (request.out != "-") console.out << TargetSummary(result);
  return ExitCode::kDone;
}

}  // namespace

ExitCode RunCalibrateTarget(const CalibrateTargetRequest& request, const Console& console) {
  const ReportFolder report(request.report, "target", request.force);
  auto obstacle = OutputFile(request.out, request.force).Obstacle();
  if (!obstacle) obstacle = report.Obstacle({"csv", "json"});
  if (obstacle) {
    Complain(console, *obstacle);
    return ExitCode::kBadInput;
  }
  auto leds = LoadNominalLeds(request.nominal, console);
  if (!leds) return ExitCode::kBadInput;
  auto measured = ReadPlacements(request, *leds, console);
  if (!measured || !ReadTilts(request, &*measured, console)) return ExitCode::kBadInput;

  const auto found =
      CalibrateTarget(PlacesOf(*leds), measured->placements, request.most_off_mm / kMmPerMetre);
  if (!found) {
    for (const std::string& line : Explain(found.error(), request, *measured, *leds)) {
      Complain(console, line);
    }
    return ExitCode::kBadInput;
  }
  const TargetResult result{
      request, std::move(*leds), measured->files, measured->placements, *found};
  if (!JudgeMounting(result, *measured, console)) return ExitCode::kBadInput;
  WarnOfPoints(result, console);
  return WriteAll(result, report, console);
}

}  // namespace tbm
