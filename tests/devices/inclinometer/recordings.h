#pragma once

#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace tbm::test {

using Bytes = std::vector<std::uint8_t>;

// The messages of one file of tests/data/recordings/inclinometer, a line each.
inline std::vector<Bytes> ReadHexFile(const std::string& name) {
  std::ifstream file(std::string(TBM_SOURCE_DIR) + "/tests/data/recordings/inclinometer/" + name);
  std::vector<Bytes> messages;
  std::string line;
  while (std::getline(file, line)) {
    std::istringstream words(line.substr(0, line.find('#')));
    Bytes message;
    std::string word;
    while (words >> word) {
      message.push_back(static_cast<std::uint8_t>(std::stoul(word, nullptr, 16)));
    }
    if (!message.empty()) messages.push_back(message);
  }
  return messages;
}

}  // namespace tbm::test
