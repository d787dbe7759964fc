#!/usr/bin/env bash
# Starts the test peer: start.sh PORT [more llama-server options]
# It answers on http://127.0.0.1:PORT/v1 once GET /health returns 200.  Stop it by its process id.
set -euo pipefail
if [ $# -lt 1 ]; then
  echo "usage: $0 PORT [llama-server options]" >&2
  exit 2
fi
here=$(cd "$(dirname "$0")" && pwd)
port=$1
shift
exec "$here/llama-server" \
  --model "$here/smollm2.gguf" --mmproj "$here/mmproj.gguf" --alias smollm2-135m \
  --host 127.0.0.1 --port "$port" --threads 1 --threads-batch 1 --threads-http 2 \
  --ctx-size 8192 --parallel 1 --batch-size 256 --ubatch-size 256 --offline "$@"
