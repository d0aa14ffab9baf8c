#pragma once

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "devices/imu/stim_encoder.h"

namespace tbm::test {

using Bytes = std::vector<std::uint8_t>;

inline Bytes operator+(Bytes a, const Bytes& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline std::vector<StimDatagram> DecodeAll(StimDecoder& decoder, const Bytes& bytes) {
  std::vector<StimDatagram> found;
  for (const std::uint8_t byte : bytes) {
    for (auto datagram = decoder.Push(byte); datagram; datagram = decoder.Next()) {
      found.push_back(*datagram);
    }
  }
  return found;
}

// The one datagram of a file of tests/data/recordings/imu.
inline Bytes ReadHexDatagram(const std::string& name) {
  std::ifstream file(std::string(TBM_SOURCE_DIR) + "/tests/data/recordings/imu/" + name);
  std::string line;
  std::getline(file, line);
  std::istringstream words(line.substr(0, line.find('#')));
  Bytes bytes;
  for (std::string word; words >> word;) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(word, nullptr, 16)));
  }
  return bytes;
}

}  // namespace tbm::test
