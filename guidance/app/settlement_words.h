#pragma once

#include <span>
#include <string>

#include "guidance/app/line_file.h"
#include "guidance/rail/settlement.h"

namespace tbm {

// Why lines cannot be compared, and in which of their files, base first.
FileFault Explain(const SettlementFailure& failure, std::span<const LineFile> lines);

// "the whole line is 4.01 mm +- 0.42 higher"
std::string ShiftText(const DatumShift& shift);

// "settlement 3.10 mm +- 0.42 at 20.00 m"
std::string PeakText(std::string_view what, const SettlementPeak& peak);

// The last epoch in a sentence: how much was compared, and what moved by more than chance gives.
std::string SentenceOf(const Settlement& settlement);

}  // namespace tbm
