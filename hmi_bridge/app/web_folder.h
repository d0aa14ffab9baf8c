#pragma once

#include <string>
#include <string_view>

#include "pose/base/result.h"

namespace tbm::hmi {

// The built page on the disk.
struct WebFolder {
  std::string folder;
  std::string page_build;  // as its index.html says
};

// `configured`, or when that is empty the one beside the program: ../share/tbm/console when it is
// installed, else where it was built. A sentence when there is no page.
Result<WebFolder, std::string> FindWebFolder(const std::string& configured);

// The content of <meta name="page-build" content="...">; empty when there is none.
std::string PageBuildOf(std::string_view index_html);

}  // namespace tbm::hmi
