# docker build -t furuta . && docker run --rm -v "$PWD":/work furuta identify log.csv -o rig.json
# Every command but `train` and `studio`; `demo` leaves its policies out, and `compare` has no `planned`: the extras rl,
# studio and plan are left out. Where your user has another number than 1000, add --user "$(id -u)": it then compiles anew.
FROM python:3.13-slim AS build
WORKDIR /source
COPY . .
RUN python -m venv /opt/furuta \
    && /opt/furuta/bin/pip install --no-cache-dir ".[report,matlab,labview,ros,mujoco,lab]" -c constraints.txt

FROM python:3.13-slim
COPY --from=build /opt/furuta /opt/furuta
RUN useradd --create-home --uid 1000 furuta && mkdir /work && chown furuta /work
USER 1000
ENV PATH=/opt/furuta/bin:$PATH FURUTA_CACHE=/home/furuta/.cache/furuta-gym
RUN furuta warm-up
WORKDIR /work
ENTRYPOINT ["furuta"]
