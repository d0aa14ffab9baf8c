#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tbm::hmi {

// Whether brackets outside of texts are nested deeper than `most`: asked before anything is parsed,
// so that what is parsed is small in every direction.
bool NestsDeeperThan(std::string_view json, std::size_t most);

// As a JSON text with its quotes. What is no UTF-8 becomes the replacement character.
std::string Quoted(std::string_view text);

}  // namespace tbm::hmi
