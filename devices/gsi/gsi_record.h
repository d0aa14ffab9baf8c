#pragma once

#include <optional>
#include <string>

#include "devices/gsi/gsi.h"
#include "devices/gsi/gsi_writer.h"

namespace tbm {

// What a block says about one point, value by value and nothing computed: for whoever works with
// the pointings of a log instead of its coordinates. Empty for blocks without a point (codes,
// remarks); an error for a value in no usable form. A slope distance of zero is a sight that failed
// and counts as absent. The prism constant comes from word 58 where there is one, else from 51.
Result<std::optional<GsiRecord>, FileFault> RecordOf(const GsiBlock& block,
                                                     const std::string& file);

}  // namespace tbm
