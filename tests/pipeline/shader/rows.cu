// Calls of the CUDA form from Python: SOURCE is the file that slangc made.

#include SOURCE

#include <vector>

namespace {

void* copied(const void* data, size_t bytes) {
    void* device = nullptr;
    if (cudaMalloc(&device, bytes) != cudaSuccess || cudaMemcpy(device, data, bytes, cudaMemcpyDefault) != cudaSuccess)
        return nullptr;
    return device;
}

}  // namespace

// Answers 64 * groups rows by an entry point; `buffers` are all but the answers, in the order of the source, `lengths`
// their bytes and then their elements. Returns the last error of CUDA.
extern "C" int answer_rows(int scatters, const void** buffers, const size_t* lengths, int count, float* answers,
                           size_t answer_bytes, int groups) {
    struct Buffer { void* data; size_t count; };
    std::vector<Buffer> parameters;
    for (int k = 0; k < count; k++) parameters.push_back({copied(buffers[k], lengths[k]), lengths[count + k]});
    parameters.push_back({copied(answers, answer_bytes), answer_bytes / 16});
    cudaMemcpyToSymbol(SLANG_globalParams, parameters.data(), sizeof(GlobalParams_0));
    if (scatters) scatter<<<groups, 64>>>(); else evaluate<<<groups, 64>>>();
    cudaMemcpy(answers, parameters.back().data, answer_bytes, cudaMemcpyDefault);
    for (const Buffer& buffer : parameters) cudaFree(buffer.data);
    return cudaGetLastError();
}
