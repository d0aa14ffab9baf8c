#include "guidance/app/study_command.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <thread>
#include <vector>

#include <fmt/format.h>

#include "guidance/app/gnuplot.h"
#include "guidance/app/output_file.h"
#include "pose/base/angle.h"
#include "pose/solve/published_study.h"

namespace tbm {
namespace {

constexpr std::array<double, 10> kNoisesPx = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0};
constexpr std::int64_t kChunk = 50;  // draws that a thread takes at a time

// The panels of the paper's figure, in its order.
struct Axis {
  const char* name;
  std::size_t index;  // into StudyVector
  const char* unit;
  double scale;  // from SI
};
constexpr double kDegPerRad = 180.0 / std::numbers::pi;
constexpr std::array<Axis, kStudyAxes> kAxes = {{{"roll", 2, "deg", kDegPerRad},
                                                 {"pitch", 0, "deg", kDegPerRad},
                                                 {"yaw", 1, "deg", kDegPerRad},
                                                 {"tx", 3, "mm", 1e3},
                                                 {"ty", 4, "mm", 1e3},
                                                 {"tz", 5, "mm", 1e3}}};

struct Method {
  StudyMethod method;
  const char* name;
};
constexpr std::array<Method, 3> kStudied = {{{StudyMethod::kVision, "vision"},
                                             {StudyMethod::kPublished, "published"},
                                             {StudyMethod::kFused, "fused"}}};

using Rows = std::array<std::array<StudyRow, 3>, kNoisesPx.size()>;  // [noise][method of kStudied]

StudyCase CaseOf(const StudyRequest& request, double noise_px) {
  StudyCase study;
  study.centre_sigma_px = noise_px;
  study.seed = request.seed;
  study.with_published = true;
  return study;
}

// Every thread takes the next chunk that nobody has; the sums are merged in the order of the
// chunks, so that the last digit does not tell how many threads there were.
Rows Simulate(const StudyRequest& request, const Console& console) {
  const std::int64_t chunks = (request.draws + kChunk - 1) / kChunk;
  const std::int64_t total = chunks * static_cast<std::int64_t>(kNoisesPx.size());
  std::vector<StudySums> sums(static_cast<std::size_t>(total));
  std::atomic<std::int64_t> next{0};
  std::atomic<std::int64_t> done{0};
  const auto work = [&] {
    for (std::int64_t task = next++; task < total; task = next++) {
      const std::int64_t first = task % chunks * kChunk;
      const std::int64_t last = std::min<std::int64_t>(first + kChunk, request.draws);
      const double noise_px = kNoisesPx[static_cast<std::size_t>(task / chunks)];
      sums[static_cast<std::size_t>(task)] =
          RunPublishedStudy(CaseOf(request, noise_px), first, last);
      ++done;
    }
  };
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const unsigned count = request.threads > 0 ? static_cast<unsigned>(request.threads) : cores;
  {
    Progress progress(console, "drawing", static_cast<std::size_t>(total));
    std::vector<std::jthread> threads;
    for (unsigned i = 0; i < count; ++i) threads.emplace_back(work);
    while (done < total) {
      progress.Show(static_cast<std::size_t>(done.load()));
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
  Rows rows;
  for (std::size_t noise = 0; noise < kNoisesPx.size(); ++noise) {
    StudySums merged;
    for (std::int64_t chunk = 0; chunk < chunks; ++chunk) {
      Merge(sums[noise * static_cast<std::size_t>(chunks) + static_cast<std::size_t>(chunk)],
            merged);
    }
    for (std::size_t m = 0; m < kStudied.size(); ++m) {
      rows[noise][m] = Summarise(merged, kStudied[m].method);
    }
  }
  return rows;
}

std::string CsvText(const Rows& rows) {
  std::string text = "noise_px,method,solved,refused";
  for (const Axis& axis : kAxes) {
    for (const char* figure : {"rmse", "bound", "mean", "mean_absolute"}) {
      text += fmt::format(",{}_{}_{}", axis.name, figure, axis.unit);
    }
  }
  text += "\n";
  for (std::size_t noise = 0; noise < rows.size(); ++noise) {
    for (std::size_t m = 0; m < kStudied.size(); ++m) {
      const StudyRow& row = rows[noise][m];
      text += fmt::format(
          "{:.1f},{},{},{}", kNoisesPx[noise], kStudied[m].name, row.solved, row.refused);
      for (const Axis& axis : kAxes) {
        for (const StudyVector* figure : {&row.rmse, &row.bound, &row.mean, &row.mean_absolute}) {
          text += fmt::format(",{:.7g}", (*figure)[axis.index] * axis.scale);
        }
      }
      text += "\n";
    }
  }
  return text;
}

std::string TableText(const Rows& rows, const StudyRequest& request) {
  std::string text = fmt::format(
      "The pose paper's simulation: 16 mm lens, 5.3 um pixels, its five LEDs at 4 m, tilts of "
      "0.005 degree,\n"
      "{} draws at each noise. RMSE, and in brackets its ratio to the Cramer-Rao bound of that "
      "method\n"
      "(published: to the bound of fused, which sees the same data).\n\n",
      request.draws);
  text += fmt::format("{:>8} {:>10}", "noise px", "method");
  for (const Axis& axis : kAxes)
    text += fmt::format(" {:>17}", fmt::format("{} {}", axis.name, axis.unit));
  text += fmt::format(" {:>8}\n", "refused");
  for (std::size_t noise = 0; noise < rows.size(); ++noise) {
    for (std::size_t m = 0; m < kStudied.size(); ++m) {
      const StudyRow& row = rows[noise][m];
      text += fmt::format(
          "{:>8} {:>10}", m == 0 ? fmt::format("{:.1f}", kNoisesPx[noise]) : "", kStudied[m].name);
      for (const Axis& axis : kAxes) {
        text += fmt::format(" {:>10.5f} ({:4.2f})",
                            row.rmse[axis.index] * axis.scale,
                            row.rmse[axis.index] / row.bound[axis.index]);
      }
      text += fmt::format(" {:>8}\n", row.refused);
    }
  }
  return text;
}

// Six panels against noise. `is_mean`: mean absolute error, with the bound times sqrt(2 / pi),
// which is the mean absolute value of a normal error that reaches it; else RMSE with the bound
// itself.
std::string PlotScript(const Rows& rows, const StudyRequest& request, bool is_mean) {
  std::string script = "$data << EOD\n";
  const double bound_scale = is_mean ? std::sqrt(2.0 / std::numbers::pi) : 1.0;
  for (std::size_t noise = 0; noise < rows.size(); ++noise) {
    script += fmt::format("{:.1f}", kNoisesPx[noise]);
    for (const Axis& axis : kAxes) {
      for (const StudyRow& row : rows[noise]) {
        const StudyVector& figure = is_mean ? row.mean_absolute : row.rmse;
        script += fmt::format(" {:.7g} {:.7g}",
                              figure[axis.index] * axis.scale,
                              row.bound[axis.index] * bound_scale * axis.scale);
      }
    }
    script += "\n";
  }
  script += fmt::format(
      "EOD\nset multiplot layout 2,3 title '{} of {} draws a point: 16 mm lens, five LEDs, 4 m, "
      "tilts 0.005 deg'\n"
      "set grid\nset xrange [0.05:1.05]\nset yrange [0:*]\nset xlabel 'centre noise [px]'\nset key "
      "left top reverse Left samplen 2 spacing 0.95\n",
      is_mean ? "Mean absolute error" : "RMSE",
      request.draws);
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    const std::size_t first =
        2 + 6 * i;  // column of vision's figure; its bound follows, then the others
    script += fmt::format("set title '{}'\nset ylabel '{}'\n", kAxes[i].name, kAxes[i].unit);
    script += fmt::format(
        "plot $data using 1:{} with linespoints pt 6 lc rgb '#c0392b' title 'vision', "
        "$data using 1:{} with linespoints pt 8 ps 1.8 lc rgb '#e08000' title 'published', "
        "$data using 1:{} with linespoints pt 7 lc rgb '#1f5fa8' title 'fused', "
        "$data using 1:{} with lines dt 2 lc rgb '#c0392b' title 'bound, vision', "
        "$data using 1:{} with lines dt 2 lc rgb '#1f5fa8' title 'bound, with tilts'\n",
        first,
        first + 2,
        first + 4,
        first + 1,
        first + 5);
  }
  return script + "unset multiplot\n";
}

std::optional<std::string> Obstacle(const StudyRequest& request) {
  if (auto fault = MakeFolder(request.out)) return fault;
  for (const char* name : {"study.csv", "study.txt", "study_rmse.png", "study_mean.png"}) {
    if (auto fault = OutputFile(request.out + "/" + name, request.force).Obstacle()) return fault;
  }
  return std::nullopt;
}

std::optional<std::string> WriteAll(const Rows& rows,
                                    const std::string& table,
                                    const StudyRequest& request) {
  if (auto fault = OutputFile(request.out + "/study.csv", request.force).Write(CsvText(rows)))
    return fault;
  return OutputFile(request.out + "/study.txt", request.force).Write(table);
}

}  // namespace

ExitCode RunStudy(const StudyRequest& request, const Console& console) {
  if (const auto fault = Obstacle(request)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  const Rows rows = Simulate(request, console);
  const std::string table = TableText(rows, request);
  if (const auto fault = WriteAll(rows, table, request)) {
    Complain(console, *fault);
    return ExitCode::kBadInput;
  }
  console.out << table << "\nwritten: " << request.out << "/study.csv, study.txt\n";
  for (const bool is_mean : {false, true}) {
    const std::string path = request.out + (is_mean ? "/study_mean.png" : "/study_rmse.png");
    // The figures are complete without the pictures.
    if (const auto fault =
            DrawPicture(PlotScript(rows, request, is_mean), 1500, 900, path, request.force)) {
      Complain(console, *fault);
    } else {
      console.out << "written: " << path << "\n";
    }
  }
  return ExitCode::kDone;
}

}  // namespace tbm
