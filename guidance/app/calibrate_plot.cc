#include "guidance/app/calibrate_plot.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "guidance/app/gnuplot.h"
#include "pose/base/angle.h"

namespace tbm {
namespace {

constexpr int kWidth_px = 1100;
constexpr int kHeight_px = 1000;

// A file's name inside a quoted string of the script: it must not end it.
std::string Label(const std::string& name) {
  constexpr std::size_t kMost = 24;
  std::string label;
  for (const char c : name.substr(0, kMost)) {
    const auto byte = static_cast<unsigned char>(c);
    label += byte < 0x20 || byte == 0x7f || c == '\'' || c == '\\' ? '?' : c;
  }
  return label;
}

// Axes of an image: v downwards, square pixels; and its frame, so that there is always a line.
std::string ImageAxes(ImageSize size) {
  return fmt::format(
      "set xrange [-0.5:{0}]\nset yrange [{1}:-0.5]\nset size ratio -1\nset xlabel 'u px'\n"
      "set ylabel 'v px'\nset tics out\n"
      "$frame << EOD\n-0.5 -0.5\n{0} -0.5\n{0} {1}\n-0.5 {1}\n-0.5 -0.5\nEOD\n",
      size.width_px - 0.5,
      size.height_px - 0.5);
}

bool IsMissing(const Coverage& coverage, ImagePart part) {
  return std::find(coverage.missing.begin(), coverage.missing.end(), part) !=
         coverage.missing.end();
}

std::string Cells(const Coverage& coverage, ImageSize size) {
  std::string script;
  for (int row = 0; row < Coverage::kCells; ++row) {
    for (int column = 0; column < Coverage::kCells; ++column) {
      const auto part = static_cast<ImagePart>(row / 2 * 3 + column / 2);
      const int points = coverage.points[static_cast<std::size_t>(row) * Coverage::kCells +
                                         static_cast<std::size_t>(column)];
      const char* colour = points > 0                  ? "#d8ecd8"
                           : IsMissing(coverage, part) ? "#f4b8b0"
                                                       : "#eeeeee";
      fmt::format_to(
          std::back_inserter(script),
          "set object rectangle from {:.2f},{:.2f} to {:.2f},{:.2f} behind fillcolor rgb '{}' "
          "fillstyle solid border lc rgb '#aaaaaa'\n",
          -0.5 + column * size.width_px / static_cast<double>(Coverage::kCells),
          -0.5 + row * size.height_px / static_cast<double>(Coverage::kCells),
          -0.5 + (column + 1) * size.width_px / static_cast<double>(Coverage::kCells),
          -0.5 + (row + 1) * size.height_px / static_cast<double>(Coverage::kCells),
          colour);
    }
  }
  for (const ImagePart part : coverage.missing) {
    const int index = static_cast<int>(part);
    fmt::format_to(
        std::back_inserter(script),
        "set label 'missing: {}' at {:.2f},{:.2f} center front textcolor rgb '#b02010'\n",
        Name(part),
        (index % 3 + 0.5) * size.width_px / 3.0,
        (index / 3 + 0.5) * size.height_px / 3.0);
  }
  return script;
}

std::string TiltText(const Coverage& coverage) {
  if (std::isnan(coverage.tilt_about_u_rad)) return "tilts unknown";
  return fmt::format("tilts {:.0f} and {:.0f} degrees about horizontal and vertical{}",
                     RadToDeg(coverage.tilt_about_u_rad),
                     RadToDeg(coverage.tilt_about_v_rad),
                     coverage.IsTilted() ? "" : ": too little");
}

// A length that the eye can compare: 1, 2 or 5 times a power of ten, not above `value`.
double RoundScale(double value) {
  const double power = std::pow(10.0, std::floor(std::log10(value)));
  const double digit = value / power;
  return power * (digit >= 5.0 ? 5.0 : (digit >= 2.0 ? 2.0 : 1.0));
}

std::string Arrows(const CameraCalibration& found, const FoundBoards& boards, double scale) {
  std::string script = "$arrows << EOD\n";
  for (std::size_t i = 0; i < found.pictures.size(); ++i) {
    if (!found.pictures[i].used) continue;
    for (std::size_t k = 0; k < boards.pixels_px[i].size(); ++k) {
      const Eigen::Vector2d& at = boards.pixels_px[i][k];
      const Eigen::Vector2d arrow = scale * found.pictures[i].residuals_px[k];
      fmt::format_to(std::back_inserter(script),
                     "{:.2f} {:.2f} {:.2f} {:.2f}\n",
                     at.x(),
                     at.y(),
                     arrow.x(),
                     arrow.y());
    }
  }
  return script + "EOD\n";
}

// Bars of used pictures, crosses on the axis' upper end for those left out.
std::string Bars(const CameraCalibration& found, const FoundBoards& boards) {
  std::string used = "$used << EOD\n";
  std::string left_out = "$left_out << EOD\n";
  std::string tics = "set xtics rotate by 60 right font ',8' (";
  bool is_any_left_out = false;
  const double top_px = 3.0 * found.residual_px;
  for (std::size_t i = 0; i < found.pictures.size(); ++i) {
    const CalibrationPicture& picture = found.pictures[i];
    is_any_left_out = is_any_left_out || !picture.used;
    if (picture.used) {
      used += fmt::format("{} {:.5f}\n", i, picture.rms_px);
    } else {
      left_out += fmt::format("{} {:.5f}\n", i, top_px);
    }
    tics += fmt::format("{}'{}' {}", i > 0 ? ", " : "", Label(boards.pictures[i].name), i);
  }
  std::string script = used + "EOD\n" + left_out + "EOD\n" + tics + ")\n";
  script += fmt::format(
      "set xrange [-1:{}]\nset yrange [0:{:.5f}]\n", found.pictures.size(), 1.1 * top_px);
  script +=
      "set xlabel ''\nset ylabel 'rms px'\nset boxwidth 0.7\nset style fill solid 0.6\n"
      "plot $used using 1:2 with boxes lc rgb '#1f5fa8' title 'each picture'";
  // gnuplot draws nothing at all when one of the lines has no point.
  if (is_any_left_out) {
    script +=
        ", $left_out using 1:2 with points pt 2 ps 1.4 lw 2 lc rgb '#c0392b' title 'left out'";
  }
  return script + "\n";
}

}  // namespace

std::optional<std::string> DrawCoverage(const Coverage& coverage,
                                        const FoundBoards& boards,
                                        const std::string& path,
                                        bool may_replace) {
  std::string script = ImageAxes(boards.size) + Cells(coverage, boards.size);
  script += fmt::format("set title '{} pictures; points in {:.0f} % of the cells; {}'\n",
                        boards.pictures.size(),
                        100.0 * coverage.share,
                        TiltText(coverage));
  script += "$points << EOD\n";
  for (const auto& pixels : boards.pixels_px) {
    for (const Eigen::Vector2d& pixel : pixels) {
      fmt::format_to(std::back_inserter(script), "{:.2f} {:.2f}\n", pixel.x(), pixel.y());
    }
  }
  script += "EOD\nplot $frame with lines lc rgb '#444444' notitle";
  if (!boards.pixels_px.empty()) {
    script += ", $points with points pt 7 ps 0.25 lc rgb '#1f5fa8' notitle";
  }
  return DrawPicture(script + "\n", kWidth_px, kHeight_px, path, may_replace);
}

std::optional<std::string> DrawResiduals(const CameraCalibration& found,
                                         const FoundBoards& boards,
                                         const std::string& path,
                                         bool may_replace) {
  const double scale = RoundScale(0.02 * boards.size.width_px / std::max(found.residual_px, 1e-6));
  std::string script = Arrows(found, boards, scale);
  script += fmt::format("set multiplot title 'residual {:.3f} px; arrows {:g} times as long'\n",
                        found.residual_px,
                        scale);
  script += "set origin 0,0.28\nset size 1,0.68\n" + ImageAxes(boards.size);
  script +=
      "plot $frame with lines lc rgb '#444444' notitle, $arrows using 1:2:3:4 with vectors "
      "size screen 0.004,25 lc rgb '#c0392b' notitle\n"
      "set origin 0,0\nset size noratio\nset size 1,0.28\n" +
      Bars(found, boards) + "unset multiplot\n";
  return DrawPicture(script, kWidth_px, kHeight_px, path, may_replace);
}

}  // namespace tbm
