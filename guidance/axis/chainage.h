#pragma once

#include <compare>
#include <optional>
#include <vector>

namespace tbm {

// Two countings of the same axis that must never be mixed up; neither converts into the other
// without the equations.

// Plan length from the start of the alignment, as the file counts it: without equations, never with
// a jump. All computing is done in it.
struct InternalChainage {
  double m = 0.0;

  auto operator<=>(const InternalChainage&) const = default;
};

// What stands on the tunnel wall. Where a design was lengthened, numbers are missing ("short
// chain") or stand twice ("long chain"); `section` tells which of two equal numbers: 0 before the
// first equation, 1 behind it, and so on.
struct OfficialChainage {
  double m = 0.0;
  int section = 0;

  auto operator<=>(const OfficialChainage&) const = default;
};

// From `at` on, the wall counts from ahead_m, up or down.
struct StationEquation {
  InternalChainage at;
  double ahead_m = 0.0;
  bool is_increasing = true;
  std::optional<double> back_m;  // what the wall says just before `at`; a check, nothing more
  int line = 0;                  // in the file it came from; 0: unknown
};

class ChainageEquations {
 public:
  ChainageEquations() = default;

  // `equations` in ascending order of `at`; what breaks the order is our mistake, Inspect() refuses
  // such a description beforehand.
  explicit ChainageEquations(std::vector<StationEquation> equations);

  // At an equation itself the number ahead is the one that counts.
  OfficialChainage ToOfficial(InternalChainage internal) const;

  // The one place that a full official chainage names. Empty when its section does not reach that
  // number, or when there is no such section. The section is taken as ending where the next begins;
  // the first and the last are endless.
  std::optional<InternalChainage> ToInternal(OfficialChainage official) const;

  // Every place where this number stands on the wall between `first` and `last`, in driving order:
  // none inside a short chain, two inside a long one.
  std::vector<InternalChainage> ToInternal(double official_m,
                                           InternalChainage first,
                                           InternalChainage last) const;

  int section_count() const { return static_cast<int>(equations_.size()) + 1; }
  const std::vector<StationEquation>& equations() const { return equations_; }

 private:
  std::vector<StationEquation> equations_;
};

}  // namespace tbm
