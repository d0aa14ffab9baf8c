#include <cmath>

#include <fmt/format.h>

#include "guidance/app/settle_command.h"

namespace tbm {
namespace {

// gnuplot draws no more than it has pixels.
constexpr std::size_t kMostRows = 4000;

// A file's name inside a quoted string of the script: it must not end it.
std::string Title(const std::string& name) {
  std::string title;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    title += byte < 0x20 || byte == 0x7f || c == '\'' || c == '\\' ? '?' : c;
  }
  return title;
}

// Distance; then for each epoch dz, half the width of its bounds, and dz where it is significant.
std::string DataBlock(const Settlement& settlement, double bound) {
  const std::size_t every = settlement.places.size() / kMostRows + 1;
  std::string script = "$data << EOD\n";
  for (std::size_t i = 0; i < settlement.places.size(); i += every) {
    const SettlementPlace& place = settlement.places[i];
    script += fmt::format("{:.4f}", place.distance_m);
    for (const auto& change : place.changes) {
      if (!change) {
        script += " NaN NaN NaN";
        continue;
      }
      script +=
          fmt::format(" {:.5f} {:.5f} {}",
                      1e3 * change->dz_m,
                      1e3 * bound * change->sigma_m,
                      change->is_significant ? fmt::format("{:.5f}", 1e3 * change->dz_m) : "NaN");
    }
    script += "\n";
  }
  return script + "EOD\n";
}

std::string TroughCurve(const TroughFit& trough) {
  return fmt::format(
      ", {:.6f}*exp(-0.5*((x-{:.6f})/{:.6f})**2) with lines lw 2 dt 2 lc rgb "
      "'#c0392b' title 'trough {:.2f} mm, width {:.2f} m'",
      -1e3 * trough.depth_m,
      trough.centre_m,
      trough.width_m,
      1e3 * trough.depth_m,
      trough.width_m);
}

}  // namespace

std::string SettlePlotScript(const Settlement& settlement,
                             const std::vector<std::string>& names,
                             const SettlementOptions& options) {
  std::string script = DataBlock(settlement, TwoSidedBound(options.level));
  script += fmt::format("set title 'height against {}; shaded: {:.4g} % bounds'\n",
                        Title(names.front()),
                        100.0 * options.level);
  script +=
      "set grid\nset bmargin 6\nset key outside below horizontal\nset xlabel 'distance along the "
      "base line, m'\n"
      "set ylabel 'change of height, mm'\nset samples 2000\n"
      "set zeroaxis lt -1 lc rgb '#888888'\nset style fill transparent solid 0.2 noborder\n";
  script += fmt::format("set xrange [{:.4f}:{:.4f}]\n",
                        settlement.places.front().distance_m,
                        settlement.places.back().distance_m + 1e-3);
  for (const double m : options.alert_m) {
    script += fmt::format(
        "set arrow from graph 0, first {0:.4f} to graph 1, first {0:.4f} nohead dt 3 lc rgb "
        "'#e08000'\n",
        -1e3 * m);
  }
  const std::size_t last = settlement.epochs.size() - 1;
  const std::size_t column = 2 + 3 * last;
  script += fmt::format(
      "plot $data using 1:(${0}-${1}):(${0}+${1}) with filledcurves lc rgb '#1f5fa8' notitle",
      column,
      column + 1);
  for (std::size_t i = 0; i < last; ++i) {
    script +=
        fmt::format(", '' using 1:{} with lines lw 1 title '{}'", 2 + 3 * i, Title(names[i + 1]));
  }
  script += fmt::format(", '' using 1:{} with lines lw 2 lc rgb '#1f5fa8' title '{}'",
                        column,
                        Title(names[last + 1]));
  // gnuplot draws nothing at all when one of the lines has no point.
  if (settlement.epochs[last].significant > 0) {
    script += fmt::format(
        ", '' using 1:{} with points pt 7 ps 0.7 lc rgb '#c0392b' title 'significant'", column + 2);
  }
  if (settlement.epochs[last].trough) script += TroughCurve(*settlement.epochs[last].trough);
  return script + "\n";
}

}  // namespace tbm
